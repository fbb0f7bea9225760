/*
 * Loads a library as Python's ctypes does with a whole path, finds all functions that the standard input names, and calls one:
 * loads LIBRARY <NAMES. On Windows what the DLL needs may lie beside it or among the system's, and nowhere else.
 */

#include <stdint.h>
#include <stdio.h>
#include <string.h>

#if defined(_WIN32)
#include <windows.h>

static void *load(const char *path)
{
    return (void *)LoadLibraryExA(path, NULL, LOAD_LIBRARY_SEARCH_DEFAULT_DIRS | LOAD_LIBRARY_SEARCH_DLL_LOAD_DIR);
}

static void *find(void *library, const char *name)
{
    return (void *)(uintptr_t)GetProcAddress((HMODULE)library, name);
}
#else
#include <dlfcn.h>

static void *load(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }

static void *find(void *library, const char *name) { return dlsym(library, name); }
#endif

int main(int argc, char **argv)
{
    char name[200];
    int count = 0, missing = 0;
    uint32_t (*version)(void);
    void *library = argc > 1 ? load(argv[1]) : NULL, *function;
    if (library == NULL) {
        printf("%s does not load\n", argc > 1 ? argv[1] : "nothing");
        return 1;
    }
    while (scanf("%199s", name) == 1) {
        count += 1;
        if (find(library, name) == NULL) {
            printf("there is no %s\n", name);
            missing += 1;
        }
    }
    function = find(library, "vrtm_version");
    if (function == NULL || count == 0 || missing != 0) {
        return 1;
    }
    memcpy(&version, &function, sizeof version);
    printf("%d functions, version %u\n", count, (unsigned)version());
    return 0;
}
