/*
 * Jobs on a host's threads, whichever of these the host gives the first task to: what the host's own functions may ask for
 * in the middle of a job, and what would wait for itself. A host that hangs is ended after a while.
 */

#include "platform.h"

#include "check.h"

#include <pthread.h>

static sheet s;
static double pose[VERTICES][4], other[VERTICES][4];
static float map[2 * MAP * MAP], before[2 * MAP * MAP];

enum { POOL = 3, QUEUE = 4096 };

/* A pool with a fixed number of threads; who waits for a loop runs no tasks of it. */
typedef struct task {
    vrtm_task_fn run;
    void *data;
    size_t index;
    size_t *left;
} task;

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
/* Held until a job's handle is written, which the host's functions read. */
static pthread_mutex_t written = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t told = PTHREAD_COND_INITIALIZER;
static task tasks[QUEUE];
static size_t taken, added;

static void add(task next)
{
    pthread_mutex_lock(&mutex);
    tasks[added++ % QUEUE] = next;
    pthread_cond_broadcast(&told);
    pthread_mutex_unlock(&mutex);
}

static void *work(void *unused)
{
    for (;;) {
        pthread_mutex_lock(&mutex);
        while (taken == added) {
            pthread_cond_wait(&told, &mutex);
        }
        const task next = tasks[taken++ % QUEUE];
        pthread_mutex_unlock(&mutex);
        if (next.run == NULL) {
            return unused;
        }
        next.run(next.data, next.index);
        pthread_mutex_lock(&mutex);
        if (next.left != NULL) {
            *next.left -= 1;
        }
        pthread_cond_broadcast(&told);
        pthread_mutex_unlock(&mutex);
    }
}

static void pooled(void *user, size_t count, vrtm_task_fn run, void *data)
{
    size_t left = count;
    for (size_t k = 0; k < count; ++k) {
        const task next = {run, data, k, &left};
        add(next);
    }
    pthread_mutex_lock(&mutex);
    while (left > 0) {
        pthread_cond_wait(&told, &mutex);
    }
    pthread_mutex_unlock(&mutex);
    (void)user;
}

static void queued(void *user, vrtm_task_fn run, void *data)
{
    const task next = {run, data, 0, NULL};
    add(next);
    (void)user;
}

static void in_turn(void *user, size_t count, vrtm_task_fn run, void *data)
{
    for (size_t k = 0; k < count; ++k) {
        run(data, k);
    }
    (void)user;
}

static void backwards(void *user, size_t count, vrtm_task_fn run, void *data)
{
    for (size_t k = count; k-- > 0;) {
        run(data, k);
    }
    (void)user;
}

typedef struct call {
    vrtm_task_fn run;
    void *data;
    size_t index;
} call;

static void *run_late(void *argument)
{
    const call *own = argument;
    platform_sleep(2 * (unsigned)own->index);
    own->run(own->data, own->index);
    return NULL;
}

/* The first task to begin is on a thread that has just been made, and the calling thread's own is the last. */
static void late(void *user, size_t count, vrtm_task_fn run, void *data)
{
    pthread_t threads[64];
    call calls[64];
    for (size_t k = 0; k < count && k < 64; ++k) {
        const call own = {run, data, k};
        calls[k] = own;
    }
    for (size_t k = 0; k + 1 < count; ++k) {
        pthread_create(&threads[k], NULL, run_late, &calls[k]);
    }
    platform_sleep(5);
    run(data, count - 1);
    for (size_t k = 0; k + 1 < count; ++k) {
        pthread_join(threads[k], NULL);
    }
    (void)user;
}

typedef struct watch {
    vrtm_job job;
    vrtm_tile tile;
    vrtm_asset asset;
    int calls, lines, wrong;
} watch;

/* Results are those before, until the end is told. */
static void ask(watch *w, int at_end)
{
    vrtm_job_progress data = vrtm_job_progress_init();
    vrtm_solve_options options = vrtm_solve_options_init();
    const vrtm_array a = sheet_positions(pose);
    vrtm_job job;
    options.replace = 1;
    w->wrong += vrtm_job_wait(w->job, VRTM_FOREVER) != VRTM_ERROR_BUSY;
    w->wrong += vrtm_job_wait(w->job, 1000) != VRTM_ERROR_BUSY;
    w->wrong += vrtm_job_destroy(w->job) != VRTM_ERROR_BUSY;
    w->wrong += vrtm_asset_submit(w->asset, &a, &options, &job) != VRTM_ERROR_BUSY;
    w->wrong += vrtm_job_get_progress(w->job, &data) != VRTM_OK || data.state != VRTM_JOB_RUNNING;
    w->wrong += fetch_map(w->tile, map) != VRTM_OK;
    w->wrong += (memcmp(map, before, sizeof map) != 0) != at_end;
}

static uint32_t on_progress(void *user, float progress)
{
    watch *w = user;
    pthread_mutex_lock(&written);
    pthread_mutex_unlock(&written);
    w->calls += 1;
    ask(w, progress == 1);
    return progress < 0;
}

/* The tile's maps were changed, so that the job has something to say about it. */
static void on_line(void *user, const vrtm_log_entry *entry)
{
    watch *w = user;
    pthread_mutex_lock(&written);
    pthread_mutex_unlock(&written);
    if (w->job.id != 0) {
        w->lines += 1;
        ask(w, 0);
    }
    (void)entry;
}

static void *destroy(void *job)
{
    return vrtm_job_destroy(*(vrtm_job *)job) == VRTM_OK ? NULL : job;
}

/* Keeps a thread of the pool busy while a job is under way. */
static int busy;

static void block(void *unused, size_t index)
{
    pthread_mutex_lock(&mutex);
    while (busy) {
        pthread_cond_wait(&told, &mutex);
    }
    pthread_mutex_unlock(&mutex);
    (void)unused;
    (void)index;
}

/* With `threads` of the pool free, which is as many as a job gets. */
static void jobs_on(const char *name, vrtm_parallel_for_fn loop, vrtm_spawn_fn spawn, uint32_t threads)
{
    watch w;
    scene made;
    vrtm_executor executor = vrtm_executor_init();
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_solve_options options = vrtm_solve_options_init();
    const vrtm_image rigidity = sheet_rigidity(&s);
    const vrtm_array a = sheet_positions(pose), b = sheet_positions(other);
    char what[64];
    memset(&w, 0, sizeof w);
    executor.parallel_for = loop;
    executor.spawn = spawn;
    desc.executor = &executor;
    desc.threads = 2;
    desc.log = on_line;
    desc.log_user = &w;
    options.progress = on_progress;
    options.progress_user = &w;
    options.threads = threads;
    if (scene_make(&made, &s, &desc, 96) != NULL || vrtm_tile_set_rigidity(made.tile, NULL) != VRTM_OK ||
        vrtm_asset_solve(made.asset, &a, NULL) != VRTM_OK || fetch_map(made.tile, before) != VRTM_OK ||
        vrtm_tile_set_rigidity(made.tile, &rigidity) != VRTM_OK) {
        check_that(0, name, vrtm_last_error());
        return;
    }
    vrtm_job job;
    w.asset = made.asset;
    w.tile = made.tile;
    snprintf(what, sizeof what, "%s: submit", name);
    busy = spawn != NULL;
    for (uint32_t k = threads; busy && k < POOL; ++k) {
        const task blocking = {block, NULL, 0, NULL};
        add(blocking);
    }
    pthread_mutex_lock(&written);
    succeeds(what, vrtm_asset_submit(made.asset, &b, &options, &w.job));
    pthread_mutex_unlock(&written);
    job = w.job;
    snprintf(what, sizeof what, "%s: wait", name);
    /* Not as long as it takes: this thread would do the work in the place of the pool. */
    while (vrtm_job_wait(job, 100) == VRTM_ERROR_TIMEOUT) {
    }
    succeeds(what, vrtm_job_wait(job, VRTM_FOREVER));
    pthread_mutex_lock(&mutex);
    busy = 0;
    pthread_cond_broadcast(&told);
    pthread_mutex_unlock(&mutex);
    snprintf(what, sizeof what, "%s: progress and log were told", name);
    check_that(w.calls > 0 && w.lines > 0, what, "");
    snprintf(what, sizeof what, "%s: they may read, and cannot wait for themselves", name);
    check_that(w.wrong == 0, what, "");

    /* Destroyed by two threads at once while it runs: one of them ends it, and the other finds it gone. */
    pthread_t pair[2];
    int ended = 0;
    w.job.id = 0;
    succeeds("solve the pose before", vrtm_asset_solve(made.asset, &a, NULL));
    fetch_map(w.tile, before);
    succeeds("submit again", vrtm_asset_submit(made.asset, &b, NULL, &job));
    for (int k = 0; k < 2; ++k) {
        pthread_create(&pair[k], NULL, destroy, &job);
    }
    for (int k = 0; k < 2; ++k) {
        void *result;
        pthread_join(pair[k], &result);
        ended += result == NULL;
    }
    snprintf(what, sizeof what, "%s: destroyed by one of two", name);
    check_that(ended == 1, what, "");
    went_well("the scene's end", scene_end(&made));
}

int main(void)
{
    pthread_t threads[POOL];
    const task end = {NULL, NULL, 0, NULL};
    platform_end_after(240);
    sheet_make(&s);
    sheet_pose(&s, 4, pose);
    sheet_pose(&s, 9, other);
    for (int k = 0; k < POOL; ++k) {
        pthread_create(&threads[k], NULL, work, NULL);
    }
    jobs_on("another thread", pooled, NULL, 2);
    jobs_on("another thread, from the queue", pooled, queued, POOL);
    jobs_on("the only thread that is free", pooled, queued, 1);
    jobs_on("in turn", in_turn, NULL, 2);
    jobs_on("backwards", backwards, NULL, 2);
    jobs_on("late", late, NULL, 2);
    for (int k = 0; k < POOL; ++k) {
        add(end);
    }
    for (int k = 0; k < POOL; ++k) {
        pthread_join(threads[k], NULL);
    }
    return finish();
}
