/*
 * What hosts need of the system beyond C, in one form for POSIX and Windows: aligned memory, libraries that are loaded by
 * hand, time, and what the system counts for the process. To be included first: it asks for the system's extensions.
 */

#ifndef PLATFORM_H
#define PLATFORM_H

#if defined(_WIN32)

#define WIN32_LEAN_AND_MEAN
#define NOMINMAX
#include <windows.h>

#include <malloc.h>
#include <tlhelp32.h>
/* Words that hosts use. */
#undef IN
#undef OUT
#undef small

#else

#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dirent.h>
#include <dlfcn.h>
#if defined(__GLIBC__)
#include <malloc.h>
#if __GLIBC_PREREQ(2, 33)
#define PLATFORM_TELLS_HEAP
#endif
#endif
#include <pthread.h>
#include <time.h>
#include <unistd.h>

#endif

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* `size` bytes at a multiple of `alignment`, or null. */
static inline void *platform_allocate(size_t alignment, size_t size)
{
#if defined(_WIN32)
    return _aligned_malloc(size, alignment);
#else
    void *block = NULL;
    return posix_memalign(&block, alignment, size) == 0 ? block : NULL;
#endif
}

static inline void platform_free(void *block)
{
#if defined(_WIN32)
    _aligned_free(block);
#else
    free(block);
#endif
}

/* Milliseconds since some time. */
static inline double platform_ms(void)
{
#if defined(_WIN32)
    LARGE_INTEGER now, second;
    QueryPerformanceCounter(&now);
    QueryPerformanceFrequency(&second);
    return 1e3 * (double)now.QuadPart / (double)second.QuadPart;
#else
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
#endif
}

static inline void platform_sleep(unsigned ms)
{
#if defined(_WIN32)
    Sleep(ms);
#else
    usleep(1000 * ms);
#endif
}

#if defined(_WIN32)
static inline DWORD WINAPI platform_end(void *seconds)
{
    Sleep(1000 * (DWORD)(UINT_PTR)seconds);
    ExitProcess(14);
}
#endif

/* Ends the process after so many seconds, if it has not ended before: for hosts that might hang. */
static inline void platform_end_after(unsigned seconds)
{
#if defined(_WIN32)
    CloseHandle(CreateThread(NULL, 0, platform_end, (void *)(UINT_PTR)seconds, 0, NULL));
#else
    alarm(seconds);
#endif
}

/* A library that is loaded, with all it needs, for this call alone; null if that fails. */
static inline void *platform_load(const char *path)
{
#if defined(_WIN32)
    return (void *)LoadLibraryA(path);
#else
    return dlopen(path, RTLD_NOW | RTLD_LOCAL);
#endif
}

/* Why the last load failed. */
static inline const char *platform_load_error(void)
{
#if defined(_WIN32)
    static char text[40];
    snprintf(text, sizeof text, "error %lu", GetLastError());
    return text;
#else
    const char *text = dlerror();
    return text != NULL ? text : "";
#endif
}

/* The address of a function or a variable, or null. */
static inline void *platform_symbol(void *library, const char *name)
{
#if defined(_WIN32)
    void *address = NULL;
    const FARPROC function = GetProcAddress((HMODULE)library, name);
    memcpy(&address, &function, sizeof address);
    return address;
#else
    return dlsym(library, name);
#endif
}

/* True if the load was taken back. */
static inline int platform_unload(void *library)
{
#if defined(_WIN32)
    return FreeLibrary((HMODULE)library) != 0;
#else
    return dlclose(library) == 0;
#endif
}

/* The name of a file in a path. */
static inline const char *platform_file_name(const char *path)
{
    const char *name = path;
    for (const char *at = path; *at != 0; ++at) {
        if (*at == '/' || *at == '\\') {
            name = at + 1;
        }
    }
    return name;
}

/* Whether a library is loaded. */
static inline int platform_is_loaded(const char *path)
{
#if defined(_WIN32)
    return GetModuleHandleA(platform_file_name(path)) != NULL;
#else
    /* It is loaded once more, if it is, and so has to be taken back. */
    void *library = dlopen(path, RTLD_NOW | RTLD_NOLOAD);
    if (library != NULL) {
        dlclose(library);
    }
    return library != NULL;
#endif
}

/* Whether a part of a file whose path contains `name` is in the process's memory, as far as the system tells. */
static inline int platform_is_mapped(const char *name)
{
    int found = 0;
#if defined(_WIN32)
    MODULEENTRY32 module;
    HANDLE all = CreateToolhelp32Snapshot(TH32CS_SNAPMODULE, GetCurrentProcessId());
    module.dwSize = sizeof module;
    for (int more = Module32First(all, &module); more; more = Module32Next(all, &module)) {
        found |= strstr(module.szExePath, name) != NULL;
    }
    CloseHandle(all);
#else
    FILE *maps = fopen("/proc/self/maps", "r");
    char line[4200];
    while (maps != NULL && fgets(line, sizeof line, maps) != NULL) {
        found |= strstr(line, name) != NULL;
    }
    if (maps != NULL) {
        fclose(maps);
    }
#endif
    return found;
}

/* Number of the process's threads; -1 where the system does not tell. */
static inline int platform_threads(void)
{
    int count = -1;
#if defined(_WIN32)
    THREADENTRY32 thread;
    HANDLE all = CreateToolhelp32Snapshot(TH32CS_SNAPTHREAD, 0);
    count = 0;
    thread.dwSize = sizeof thread;
    for (int more = Thread32First(all, &thread); more; more = Thread32Next(all, &thread)) {
        count += thread.th32OwnerProcessID == GetCurrentProcessId();
    }
    CloseHandle(all);
#else
    FILE *status = fopen("/proc/self/status", "r");
    char line[256];
    while (status != NULL && fgets(line, sizeof line, status) != NULL) {
        sscanf(line, "Threads: %d", &count);
    }
    if (status != NULL) {
        fclose(status);
    }
#endif
    return count;
}

/* KiB that the process holds: on Windows, of its heaps, elsewhere, less those of files that are mapped. 0 where the system
 * does not tell, or PLATFORM_EMULATED is set: an emulator's memory is counted with the program's. */
static inline long platform_memory(void)
{
#if defined(_WIN32)
    HANDLE heaps[256];
    const DWORD count = GetProcessHeaps(256, heaps);
    SIZE_T bytes = 0;
    for (DWORD k = 0; k < count && k < 256; ++k) {
        PROCESS_HEAP_ENTRY entry;
        entry.lpData = NULL;
        HeapLock(heaps[k]);
        while (HeapWalk(heaps[k], &entry)) {
            bytes += (entry.wFlags & PROCESS_HEAP_ENTRY_BUSY) != 0 ? entry.cbData : 0;
        }
        HeapUnlock(heaps[k]);
    }
    return (long)(bytes / 1024);
#else
    FILE *file = fopen("/proc/self/statm", "r");
    long all = 0, pages = 0, shared = 0;
    if (getenv("PLATFORM_EMULATED") != NULL || file == NULL || fscanf(file, "%ld %ld %ld", &all, &pages, &shared) != 3) {
        pages = shared = 0;
    }
    if (file != NULL) {
        fclose(file);
    }
    return (pages - shared) * (sysconf(_SC_PAGESIZE) / 1024);
#endif
}

/* KiB that are allocated on the heaps, where the system tells; otherwise what the process holds. Free memory that glibc
 * keeps in its arenas depends on which threads met there: it comes and goes by megabytes. */
static inline long platform_heap(void)
{
#if defined(PLATFORM_TELLS_HEAP)
    const struct mallinfo2 heap = mallinfo2();
    return (long)((heap.uordblks + heap.hblkhd) / 1024);
#else
    return platform_memory();
#endif
}

/* Number of open files, on Windows of all handles; 0 where the system does not tell. */
static inline int platform_open_files(void)
{
#if defined(_WIN32)
    DWORD count = 0;
    return GetProcessHandleCount(GetCurrentProcess(), &count) ? (int)count : 0;
#else
    int count = 0;
    DIR *open = opendir("/proc/self/fd");
    while (open != NULL && readdir(open) != NULL) {
        count += 1;
    }
    if (open != NULL) {
        closedir(open);
    }
    return count;
#endif
}

/* Number of indices for thread-local storage (keys of POSIX threads) that the process has left. */
static inline int platform_free_indices(void)
{
    enum { MOST = 8192 };
    int count = 0;
#if defined(_WIN32)
    static DWORD taken[MOST];
    /* A process has some for threads and others for fibers. */
    while (count < MOST && (taken[count] = TlsAlloc()) != TLS_OUT_OF_INDEXES) {
        count += 1;
    }
    for (int k = 0; k < count; ++k) {
        TlsFree(taken[k]);
    }
    const int of_threads = count;
    for (count = 0; count < MOST && (taken[count] = FlsAlloc(NULL)) != FLS_OUT_OF_INDEXES;) {
        count += 1;
    }
    for (int k = 0; k < count; ++k) {
        FlsFree(taken[k]);
    }
    return of_threads + count;
#else
    static pthread_key_t taken[MOST];
    while (count < MOST && pthread_key_create(&taken[count], NULL) == 0) {
        count += 1;
    }
    for (int k = 0; k < count; ++k) {
        pthread_key_delete(taken[k]);
    }
    return count;
#endif
}

#endif
