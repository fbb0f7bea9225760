/*
 * A host without an allocator of its own, in a process whose memory is short. The first argument says how:
 *   interposed [most]   this program's malloc, calloc, realloc, posix_memalign and aligned_alloc take the place of the
 *                       system's, for the library as well, and let the n-th allocation of at least 4 KiB fail, n = 1, 2,
 *                       3 and so on, in steps of at most `most` rounds (0 = any number);
 *   limited             the address space is limited (RLIMIT_AS) to what is in use and a little more.
 */

#define _GNU_SOURCE

#include "allocate_rounds.h"

#include <errno.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

/* The system's allocator, by the names that glibc gives it beside the usual ones. */
extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *block, size_t size);
extern void *__libc_memalign(size_t alignment, size_t size);

/* Whether allocations are counted: in calls of the library alone. */
static atomic_int inside;

/* Whether an allocation has to fail. */
static int fails_now(size_t size)
{
    if (size < 4096 || !atomic_load(&inside) || !is_to_fail()) {
        return 0;
    }
    errno = ENOMEM;
    return 1;
}

void *malloc(size_t size)
{
    return fails_now(size) ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    return fails_now(size != 0 && count > SIZE_MAX / size ? SIZE_MAX : count * size) ? NULL : __libc_calloc(count, size);
}

void *realloc(void *block, size_t size)
{
    return fails_now(size) ? NULL : __libc_realloc(block, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    return fails_now(size) ? NULL : __libc_memalign(alignment, size);
}

int posix_memalign(void **block, size_t alignment, size_t size)
{
    void *found = fails_now(size) ? NULL : __libc_memalign(alignment, size);
    if (found == NULL) {
        return ENOMEM;
    }
    *block = found;
    return 0;
}

static vrtm_status run_inside(int step, work *w)
{
    vrtm_status status;
    atomic_store(&inside, 1);
    status = run_plain(step, w);
    atomic_store(&inside, 0);
    return status;
}

static void interposed(long most)
{
    char line[100];
    long all;
    run_step = run_inside;
    reference(VRTM_BACKEND_CPU, NULL);
    check_that(expected[1].allocations > 10, "the library's allocations are seen", "they are not");
    all = rounds(VRTM_BACKEND_CPU, NULL, 0, most);
    all += rounds(VRTM_BACKEND_CPU, NULL, 1, most);
    snprintf(line, sizeof line, "%ld failures in all", all);
    check_that(all > (most == 1 ? 40 : 100), line, "too few");
}

/* Bytes of address space in use. */
static size_t address_space(void)
{
    FILE *file = fopen("/proc/self/statm", "r");
    long pages = 0;
    if (file == NULL || fscanf(file, "%ld", &pages) != 1) {
        pages = 0;
    }
    if (file != NULL) {
        fclose(file);
    }
    return (size_t)pages * (size_t)sysconf(_SC_PAGESIZE);
}

static void limit(size_t more)
{
    struct rlimit limit;
    getrlimit(RLIMIT_AS, &limit);
    limit.rlim_cur = more == SIZE_MAX ? limit.rlim_max : address_space() + more;
    setrlimit(RLIMIT_AS, &limit);
}

/* Each step with so many more bytes of address space, and if that is too little, once more without a limit. */
static void limited(size_t more)
{
    static work w;
    char line[100];
    const char *wrong = NULL;
    long failed = 0;
    work_begin(&w, VRTM_BACKEND_CPU, NULL);
    for (int k = 0; k < STEPS && wrong == NULL; ++k) {
        const uint64_t result_before = last_result(&w), written_before = written(&w);
        vrtm_status status;
        malloc_trim(0);
        limit(more);
        status = run_plain(k, &w);
        limit(SIZE_MAX);
        if (status != VRTM_OK) {
            failed += 1;
            wrong = harm(status, &w, result_before, written_before);
            status = run_plain(k, &w);
        }
        if (wrong == NULL && status != VRTM_OK) {
            wrong = vrtm_last_error();
        } else if (wrong == NULL && last_result(&w) != expected[k].result) {
            wrong = "the result has other bits";
        }
    }
    snprintf(line, sizeof line, "%zu KiB more: %ld of %d steps fail", more >> 10, failed, (int)STEPS);
    check_that(wrong == NULL, line, wrong == NULL ? "" : wrong);
    work_end(&w);
}

int main(int count, char **arguments)
{
    const long most = count > 2 ? atol(arguments[2]) : 0;
    prepare_inputs();
    if (count > 1 && strcmp(arguments[1], "limited") == 0) {
        /* Large blocks have pages of their own, so that what one call frees does not serve the next one; and there are no
         * further arenas, each of which reserves 64 MiB. */
        mallopt(M_ARENA_MAX, 1);
        mallopt(M_MMAP_THRESHOLD, 32 << 10);
        mallopt(M_TRIM_THRESHOLD, 32 << 10);
        reference(VRTM_BACKEND_CPU, NULL);
        for (size_t more = 0; more <= 64u << 20; more = more == 0 ? 64 << 10 : 2 * more) {
            limited(more);
        }
    } else {
        interposed(most);
    }
    return finish();
}
