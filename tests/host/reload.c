/*
 * The library is loaded, used and unloaded a thousand times, as a session does in which a plug-in is worked on: the process
 * has no less of what it can run out of than before, such as the indices of thread-local storage, of which Windows has
 * about a thousand. The arguments are the library's path; the number of times; and in each how many of these it solves, 1
 * without it: in the others it makes a device alone.
 */

#include "loaded.h"

#include <pthread.h>

/* Makes a device, and a mistake: what is called most often. */
static void *glance(void)
{
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device device;
    desc.backend = VRTM_BACKEND_CPU;
    if (api.vrtm_device_create(&desc, &device) != VRTM_OK || api.vrtm_device_destroy(device) != VRTM_OK ||
        api.vrtm_device_destroy(device) != VRTM_ERROR_INVALID_HANDLE) {
        return (void *)"a device is not made, or not destroyed";
    }
    stale = device;
    return NULL;
}

/* A thread that lives on: it uses the library whenever it is asked to. */
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t told = PTHREAD_COND_INITIALIZER;
static int asked, ended;
static void *answer;

static void *live(void *nothing)
{
    pthread_mutex_lock(&mutex);
    while (!ended) {
        if (asked) {
            answer = use(&cpu_alone);
            asked = 0;
            pthread_cond_broadcast(&told);
        }
        pthread_cond_wait(&told, &mutex);
    }
    pthread_mutex_unlock(&mutex);
    return nothing;
}

static void *ask(void)
{
    pthread_mutex_lock(&mutex);
    asked = 1;
    pthread_cond_broadcast(&told);
    while (asked) {
        pthread_cond_wait(&told, &mutex);
    }
    pthread_mutex_unlock(&mutex);
    return answer;
}

int main(int count, char **arguments)
{
    static float first[2 * MAP * MAP];
    const int rounds = count > 2 ? atoi(arguments[2]) : 1000, every = count > 3 ? atoi(arguments[3]) : 1;
    int loaded = 0, used = 0, unloaded = 0, gone = 0, same = 0, indices = 0, threads = 0, files = 0;
    const char *wrong = "";
    char detail[100];
    long memory = 0;
    pthread_t living;
    sheet_make(&s);
    if (pthread_create(&living, NULL, live, NULL) != 0) {
        return 1;
    }
    for (int round = 0; round < rounds; ++round) {
        void *result = (void *)"no thread";
        void *library = count > 1 ? load(arguments[1]) : NULL;
        if (library == NULL) {
            wrong = count > 1 ? platform_load_error() : "the library's path is missing";
            break;
        }
        loaded += 1;
        /* By turns on this thread, on one that lives on, and on one that ends. */
        pthread_t thread;
        const int turn = round / every % 3;
        if (round % every != 0) {
            result = glance();
            memcpy(map, first, sizeof map);
        } else if (turn == 0) {
            result = use(&cpu_alone);
        } else if (turn == 1) {
            result = ask();
        } else if (pthread_create(&thread, NULL, use, &cpu_alone) == 0) {
            pthread_join(thread, &result);
        }
        used += result == NULL;
        wrong = result != NULL ? result : wrong;
        if (round == 0) {
            memcpy(first, map, sizeof first);
        }
        same += memcmp(first, map, sizeof first) == 0;
        memset(map, 0, sizeof map);
        unloaded += platform_unload(library);
        gone += !platform_is_loaded(arguments[1]);
        /* What the system itself sets up, it sets up in the first rounds. */
        if (round == 2 * every) {
            indices = platform_free_indices();
            threads = platform_threads();
            files = platform_open_files();
        }
        if (round == rounds / 5) {
            memory = platform_heap();
        }
    }
    snprintf(detail, sizeof detail, "%d of %d", loaded, rounds);
    check_that(loaded == rounds, "it is loaded each time", *wrong != 0 ? wrong : detail);
    snprintf(detail, sizeof detail, "%d of %d", used, rounds);
    check_that(used == rounds, "and used", *wrong != 0 ? wrong : detail);
    snprintf(detail, sizeof detail, "%d of %d", same, rounds);
    check_that(same == rounds, "with the same bits", detail);
    snprintf(detail, sizeof detail, "%d and %d of %d", unloaded, gone, rounds);
    check_that(unloaded == rounds && gone == rounds, "and unloaded, and is gone", detail);
    snprintf(detail, sizeof detail, "%d of %d are left", platform_free_indices(), indices);
    check_that(platform_free_indices() == indices && indices > 0, "no index of thread-local storage is lost", detail);
    snprintf(detail, sizeof detail, "%d, before %d", platform_threads(), threads);
    /* One of the system's own may end only now. */
    check_that(platform_threads() <= threads, "no thread is left", detail);
    snprintf(detail, sizeof detail, "%d, before %d", platform_open_files(), files);
    check_that(platform_open_files() == files, "nothing is left open", detail);
    memory = platform_heap() - memory;
    snprintf(detail, sizeof detail, "nor memory: after the first fifth of these the process grew by %ld KiB", memory);
    /* Wine itself keeps 256 bytes of each load; a thread that lives on keeps 112 of std. */
    check_that(memory < 512, detail, "");
    pthread_mutex_lock(&mutex);
    ended = 1;
    pthread_cond_broadcast(&told);
    pthread_mutex_unlock(&mutex);
    pthread_join(living, NULL);
    return finish();
}
