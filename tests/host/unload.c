/*
 * The library is loaded, used and unloaded several times, as a host does with a plug-in. Its path is the program's argument.
 *
 * The first round solves on the CPU from the main thread, the next two on a thread that ends before the unload: nothing of
 * the library stays in memory. The last round uses a GPU, if there is one, from the main thread: what a GPU's driver and
 * wgpu keep for a thread that lives on may keep the library, but the thread must not be harmed.
 */

#include "loaded.h"

#include <pthread.h>

int main(int count, char **arguments)
{
    static float first[2 * MAP * MAP];
    sheet_make(&s);
    /* Where the environment asks for a GPU, there is no round without one. */
    for (int round = getenv("VRTM_DEVICE") != NULL ? 1 : 0; round < 4; ++round) {
        const int on_a_thread = round == 1 || round == 2;
        void *library = count > 1 ? load(arguments[1]) : NULL;
        if (!check_that(library != NULL, "load", count > 1 ? platform_load_error() : "the library's path is missing")) {
            return finish();
        }
        check_that(api.vrtm_version() == VRTM_VERSION, "version", "");
        const char *wrong = NULL;
        if (on_a_thread) {
            pthread_t thread;
            void *result = (void *)"no thread";
            if (pthread_create(&thread, NULL, use, NULL) == 0) {
                pthread_join(thread, &result);
            }
            wrong = result;
        } else {
            wrong = use(round == 0 ? &cpu_alone : NULL);
        }
        check_that(wrong == NULL, on_a_thread ? "solve on a thread" : "solve on the main thread",
                   wrong != NULL ? wrong : "");
        check_that(platform_unload(library), "unload", "");
        if (round < 3) {
            check_that(!platform_is_loaded(arguments[1]), "it is gone from memory", "still there");
            check_that(!platform_is_mapped(platform_file_name(arguments[1])), "nothing of it is mapped", "still mapped");
        }
        /* The first round is the CPU's, which has other bits than a GPU. */
        if (round == 1) {
            memcpy(first, map, sizeof first);
        } else if (round > 1) {
            check_that(memcmp(first, map, sizeof first) == 0, "the same bits as before", "");
        }
    }
    return finish();
}
