/*
 * Jobs, cancelling and progress through the C API: a job beside the host's own work, what it keeps alive, what is busy
 * meanwhile, a host's threads and its task queue. A gate holds solves while a test needs them under way, so that
 * nothing depends on how fast the machine is.
 */

#include "platform.h"

#include "check.h"

#include <pthread.h>

static sheet s;
static double pose[VERTICES][4], other[VERTICES][4];
static float map[2 * MAP * MAP], first[2 * MAP * MAP], second[2 * MAP * MAP];
static float corners[2 * CORNERS];
/* A grid whose solve takes several times as long as the time between two calls of a progress function. */
static const uint32_t large = 160;

static scene make(const vrtm_executor *executor, uint32_t grid)
{
    scene made;
    vrtm_device_desc desc = vrtm_device_desc_init();
    desc.executor = executor;
    desc.threads = 2;
    memset(&made, 0, sizeof made);
    went_well("a scene is made", scene_make(&made, &s, &desc, grid));
    return made;
}

static void end(scene made)
{
    went_well("a scene is destroyed", scene_end(&made));
}

static int same(const float *a, const float *b)
{
    return memcmp(a, b, sizeof first) == 0;
}

/* True if the first result is read, with all that belongs to it. */
static int reads_first(scene of)
{
    vrtm_asset_report report = vrtm_asset_report_init();
    vrtm_tile found;
    return fetch_map(of.tile, map) == VRTM_OK && same(first, map) &&
           vrtm_asset_fetch_corner_uvs(of.asset, 0, corners, CORNERS) == VRTM_OK &&
           vrtm_asset_get_report(of.asset, &report) == VRTM_OK &&
           find_udim(of.asset, 1001, &found) == VRTM_OK;
}

static vrtm_job_progress progress_of(vrtm_job job)
{
    vrtm_job_progress data = vrtm_job_progress_init();
    if (vrtm_job_get_progress(job, &data) != VRTM_OK) {
        data.state = -1;
    }
    return data;
}

/* A progress function that holds its solve while the gate is closed. */
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static int closed, held;

static uint32_t at_gate(void *unused, float progress)
{
    pthread_mutex_lock(&mutex);
    while (closed) {
        held = 1;
        pthread_cond_broadcast(&changed);
        pthread_cond_wait(&changed, &mutex);
    }
    pthread_mutex_unlock(&mutex);
    (void)unused;
    return progress < 0;
}

static void close_gate(void)
{
    pthread_mutex_lock(&mutex);
    closed = 1;
    held = 0;
    pthread_mutex_unlock(&mutex);
}

/* Returns once a solve stands at the gate. */
static void await_solve(void)
{
    pthread_mutex_lock(&mutex);
    while (!held) {
        pthread_cond_wait(&changed, &mutex);
    }
    pthread_mutex_unlock(&mutex);
}

static void open_gate(void)
{
    pthread_mutex_lock(&mutex);
    closed = 0;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&mutex);
}

static vrtm_solve_options through_gate(void)
{
    vrtm_solve_options options = vrtm_solve_options_init();
    options.progress = at_gate;
    return options;
}

/* Another pose in place of what uses the asset. */
typedef struct newer {
    vrtm_asset asset;
    vrtm_job job;
    vrtm_status status;
} newer;

static void *replace(void *data)
{
    newer *n = data;
    const vrtm_array b = sheet_positions(other);
    vrtm_solve_options options = vrtm_solve_options_init();
    options.replace = 1;
    n->status = vrtm_asset_submit(n->asset, &b, &options, &n->job);
    return NULL;
}

static void *solve_held(void *asset)
{
    const vrtm_array a = sheet_positions(pose);
    const vrtm_solve_options options = through_gate();
    const vrtm_status status = vrtm_asset_solve(*(vrtm_asset *)asset, &a, &options);
    return status == VRTM_OK || status == VRTM_ERROR_CANCELLED ? NULL : asset;
}

/* Two threads replace a job or a call that stands at the gate, at once: each has its turn. */
static void newest_wins(int of_a_call)
{
    scene made = make(NULL, large);
    const vrtm_array a = sheet_positions(pose);
    vrtm_solve_options options = through_gate();
    vrtm_job job = {0};
    pthread_t solve, threads[2];
    newer by[2] = {{made.asset, {0}, VRTM_OK}, {made.asset, {0}, VRTM_OK}};
    void *failed = NULL;
    close_gate();
    if (of_a_call) {
        pthread_create(&solve, NULL, solve_held, &made.asset);
    } else {
        succeeds("submit", vrtm_asset_submit(made.asset, &a, &options, &job));
    }
    await_solve();
    options.replace = 1;
    vrtm_array wrong = a;
    wrong.count -= 1;
    fails("a wrong pose replaces nothing", vrtm_asset_submit(made.asset, &wrong, &options, &by[0].job),
          BAD, "positions: 168");
    fails("nor does a call", vrtm_asset_solve(made.asset, &a, &options), BAD,
          "options.replace: only vrtm_asset_submit");
    for (int k = 0; k < 2; ++k) {
        pthread_create(&threads[k], NULL, replace, &by[k]);
    }
    open_gate();
    if (of_a_call) {
        pthread_join(solve, &failed);
    } else {
        const vrtm_status end_of_it = vrtm_job_wait(job, VRTM_FOREVER);
        failed = end_of_it == VRTM_OK || end_of_it == VRTM_ERROR_CANCELLED ? NULL : &made;
        succeeds("destroy the replaced job", vrtm_job_destroy(job));
    }
    check_that(failed == NULL, "what was replaced ended", vrtm_last_error());
    int done = 0;
    for (int k = 0; k < 2; ++k) {
        pthread_join(threads[k], NULL);
        done += by[k].status == VRTM_OK && vrtm_job_wait(by[k].job, VRTM_FOREVER) == VRTM_OK;
        succeeds("destroy", vrtm_job_destroy(by[k].job));
    }
    check_that(done >= 1 && fetch_map(made.tile, map) == VRTM_OK && same(second, map), "the newest pose won",
               vrtm_last_error());
    end(made);
}

/* What another thread does to an asset whose solve stands at the gate: cancel, or destroy. */
typedef struct held_asset {
    vrtm_asset asset;
    vrtm_status (*call)(vrtm_asset);
} held_asset;

static void *call_held(void *data)
{
    const held_asset *h = data;
    await_solve();
    const vrtm_status status = h->call(h->asset);
    open_gate();
    return status == VRTM_OK ? NULL : data;
}

static void plain_jobs(void)
{
    scene made = make(NULL, large);
    vrtm_array a = sheet_positions(pose), b = sheet_positions(other);
    const vrtm_solve_options options = through_gate();
    vrtm_job job, again;
    vrtm_job_progress data;
    close_gate();
    succeeds("submit", vrtm_asset_submit(made.asset, &a, &options, &job));
    await_solve();
    fails("the asset is busy: submit", vrtm_asset_submit(made.asset, &a, NULL, &again), VRTM_ERROR_BUSY, "using");
    fails("the asset is busy: solve", vrtm_asset_solve(made.asset, &a, NULL), VRTM_ERROR_BUSY, "using");
    fails("the asset is busy: set", vrtm_tile_set_mask(made.tile, NULL), VRTM_ERROR_BUSY, "using");
    fails("there is no result yet", fetch_map(made.tile, map), VRTM_ERROR_NOT_SOLVED, "solve first");
    fails("a job that is not done", vrtm_job_wait(job, 0), VRTM_ERROR_TIMEOUT, "not done yet");
    data = progress_of(job);
    check_that(data.state == VRTM_JOB_RUNNING && data.status == VRTM_OK, "it is running", "");
    /* The inputs were copied. */
    memset(pose, 0xff, sizeof pose);
    open_gate();
    succeeds("wait", vrtm_job_wait(job, VRTM_FOREVER));
    sheet_pose(&s, 4, pose);
    succeeds("wait again", vrtm_job_wait(job, 0));
    data = progress_of(job);
    check_that(data.state == VRTM_JOB_DONE && data.status == VRTM_OK && data.progress == 1 && data.ms > 0,
               "it is done", "");
    succeeds("a cancel comes too late", vrtm_job_cancel(job));
    succeeds("and changes nothing", vrtm_job_wait(job, VRTM_FOREVER));
    succeeds("fetch", fetch_map(made.tile, first));
    succeeds("destroy", vrtm_job_destroy(job));
    fails("destroy twice", vrtm_job_destroy(job), GONE, "job");
    fails("wait for a destroyed job", vrtm_job_wait(job, 0), GONE, "job");
    job.id = made.asset.id;
    fails("an asset is no job", vrtm_job_cancel(job), GONE, "job");
    job.id = 0;
    fails("zero is no job", vrtm_job_get_progress(job, &data), GONE, "zero");

    /* The same bits as a blocking call's. */
    scene fresh = make(NULL, large);
    succeeds("a blocking solve", vrtm_asset_solve(fresh.asset, &a, NULL));
    succeeds("and its map", fetch_map(fresh.tile, map));
    check_that(same(first, map), "a job has the bits of a call", "");
    end(fresh);

    /* The last result while the next one is computed, then the next one. */
    close_gate();
    succeeds("submit the next pose", vrtm_asset_submit(made.asset, &b, &options, &job));
    await_solve();
    check_that(reads_first(made), "the last result is read meanwhile, never busy", vrtm_last_error());
    open_gate();
    int good = 1;
    while (good && vrtm_job_wait(job, 0) == VRTM_ERROR_TIMEOUT) {
        /* Else the job was done before the map was read. */
        good = reads_first(made) || vrtm_job_wait(job, VRTM_FOREVER) == VRTM_OK;
    }
    check_that(good, "and until the next one is there", vrtm_last_error());
    succeeds("the next pose", vrtm_job_wait(job, VRTM_FOREVER));
    succeeds("the next result", fetch_map(made.tile, second));
    check_that(!same(first, second), "which is another one", "");
    succeeds("destroy a job that is done", vrtm_job_destroy(job));

    /* Cancelled, and destroyed while it runs. */
    close_gate();
    succeeds("submit the first pose", vrtm_asset_submit(made.asset, &a, &options, &job));
    await_solve();
    succeeds("cancel", vrtm_job_cancel(job));
    open_gate();
    fails("it was cancelled", vrtm_job_wait(job, VRTM_FOREVER), VRTM_ERROR_CANCELLED, "cancelled");
    data = progress_of(job);
    check_that(data.state == VRTM_JOB_DONE && data.status == VRTM_ERROR_CANCELLED, "and says so", "");
    check_that(fetch_map(made.tile, map) == VRTM_OK && same(second, map), "the last result stays", "");
    close_gate();
    succeeds("the asset can be solved at once", vrtm_asset_submit(made.asset, &a, &options, &again));
    succeeds("destroy the cancelled job", vrtm_job_destroy(job));
    await_solve();
    succeeds("cancel that, too", vrtm_job_cancel(again));
    open_gate();
    succeeds("destroy a job under way", vrtm_job_destroy(again));
    check_that(fetch_map(made.tile, map) == VRTM_OK && same(second, map), "the last result stays again", "");
    succeeds("cancel without a solve", vrtm_asset_cancel(made.asset));
    succeeds("solve after all that", vrtm_asset_solve(made.asset, &a, NULL));
    check_that(fetch_map(made.tile, map) == VRTM_OK && same(first, map), "with the same bits as before", "");

    /* The asset and the device may go before the job. */
    close_gate();
    succeeds("submit once more", vrtm_asset_submit(made.asset, &b, &options, &job));
    await_solve();
    end(made);
    open_gate();
    fails("a job of a destroyed asset ends", vrtm_job_wait(job, VRTM_FOREVER), VRTM_ERROR_CANCELLED, "cancelled");
    succeeds("destroy it", vrtm_job_destroy(job));
}

/* Counts its calls, and cancels after some. */
typedef struct watch {
    int calls, cancel_at, falls, busy;
    float last;
    vrtm_asset asset;
    vrtm_job job;
    pthread_t thread;
} watch;

static uint32_t on_progress(void *user, float progress)
{
    watch *w = user;
    vrtm_asset_report report = vrtm_asset_report_init();
    const vrtm_status status = vrtm_asset_get_report(w->asset, &report);
    w->calls += 1;
    if (w->calls <= 4) {
        platform_sleep(5); /* The next call is then due at once, so that even a quick solve has four. */
    }
    w->falls += progress < w->last;
    w->last = progress;
    w->thread = pthread_self();
    w->busy += status != VRTM_OK && status != VRTM_ERROR_NOT_SOLVED;
    w->busy += vrtm_asset_set_vertex_rigidity(w->asset, NULL) != VRTM_ERROR_BUSY;
    newer n = {w->asset, {0}, VRTM_OK};
    replace(&n);
    w->busy += n.status != VRTM_ERROR_BUSY;
    if (w->job.id != 0) {
        w->busy += vrtm_job_wait(w->job, VRTM_FOREVER) != VRTM_ERROR_BUSY;
        w->busy += vrtm_job_destroy(w->job) != VRTM_ERROR_BUSY;
    }
    return w->calls == w->cancel_at;
}

static void *wait_for(void *job)
{
    return vrtm_job_wait(*(vrtm_job *)job, VRTM_FOREVER) == VRTM_OK ? NULL : job;
}

static void progress_and_cancelling(void)
{
    scene made = make(NULL, large);
    vrtm_array a = sheet_positions(pose);
    vrtm_solve_options options = vrtm_solve_options_init();
    watch w;
    memset(&w, 0, sizeof w);
    w.asset = made.asset;
    options.progress = on_progress;
    options.progress_user = &w;
    succeeds("a solve that tells its progress", vrtm_asset_solve(made.asset, &a, &options));
    check_that(w.calls > 3 && w.falls == 0 && w.last > 0 && w.last <= 1, "it was told", "");
    check_that(w.busy == 0, "a progress function may read, and not change", "");
    check_that(pthread_equal(w.thread, pthread_self()), "on the calling thread", "");
    fetch_map(made.tile, first);
    memset(&w, 0, sizeof w);
    w.asset = made.asset;
    w.cancel_at = 3;
    a = sheet_positions(other);
    fails("its answer cancels", vrtm_asset_solve(made.asset, &a, &options), VRTM_ERROR_CANCELLED, "cancelled");
    check_that(w.calls == 3, "at once", "");
    check_that(fetch_map(made.tile, map) == VRTM_OK && same(first, map), "the last result stays", "");

    /* In a job: on the job's thread, where waiting for oneself is an error. */
    memset(&w, 0, sizeof w);
    w.asset = made.asset;
    succeeds("a job that tells its progress", vrtm_asset_submit(made.asset, &a, &options, &w.job));
    pthread_t waiting[3];
    int failed = 0;
    for (int k = 0; k < 3; ++k) {
        failed += pthread_create(&waiting[k], NULL, wait_for, &w.job) != 0;
    }
    for (int k = 0; k < 3; ++k) {
        void *result;
        failed += pthread_join(waiting[k], &result) != 0 || result != NULL;
    }
    check_that(failed == 0, "several threads wait for one job", "");
    check_that(w.calls > 3 && w.falls == 0 && !pthread_equal(w.thread, pthread_self()), "it was told", "");
    succeeds("destroy the job", vrtm_job_destroy(w.job));

    /* From another thread: cancel, and destroy. */
    pthread_t thread;
    a = sheet_positions(pose);
    options = through_gate();
    close_gate();
    held_asset by = {made.asset, vrtm_asset_cancel};
    pthread_create(&thread, NULL, call_held, &by);
    fails("cancelled by another thread", vrtm_asset_solve(made.asset, &a, &options), VRTM_ERROR_CANCELLED, "cancelled");
    pthread_join(thread, NULL);
    by.call = vrtm_asset_destroy;
    close_gate();
    pthread_create(&thread, NULL, call_held, &by);
    fails("destroyed by another thread", vrtm_asset_solve(made.asset, &a, &options), VRTM_ERROR_CANCELLED, "cancelled");
    pthread_join(thread, NULL);
    fails("the asset is gone", vrtm_asset_solve(made.asset, &a, NULL), GONE, "no living asset");
    succeeds("the device is not", vrtm_device_destroy(made.device));
}

/* A host's threads: its parallel loop runs tasks in turn, its queue keeps them for later. */
typedef struct host {
    int loops, others;
    pthread_t main;
    vrtm_task_fn task[6];
    void *data[6];
    int queued;
} host;

static void in_turn(void *user, size_t count, vrtm_task_fn task, void *data)
{
    host *h = user;
    h->loops += 1;
    h->others += !pthread_equal(h->main, pthread_self());
    for (size_t k = 0; k < count; ++k) {
        task(data, k);
    }
}

static void queue(void *user, vrtm_task_fn task, void *data)
{
    host *h = user;
    h->task[h->queued] = task;
    h->data[h->queued] = data;
    h->queued += 1;
}

/* The threads of the process. The system may count one that has ended for a moment longer. */
static int threads_left(int wanted)
{
    const double end = platform_ms() + 5000;
    while (platform_threads() > wanted && platform_ms() < end) {
        platform_sleep(1);
    }
    return platform_threads();
}

/* Counting takes long on some systems: it is done for a fifth of the time at most. */
static uint32_t count_threads(void *most, float progress)
{
    static double next;
    const double start = platform_ms();
    if (start >= next) {
        const int now = platform_threads();
        *(int *)most = now > *(int *)most ? now : *(int *)most;
        next = platform_ms() + 4 * (platform_ms() - start);
    }
    return progress < 0;
}

static void a_host_s_threads(void)
{
    host h;
    vrtm_executor executor = vrtm_executor_init();
    vrtm_solve_options options = vrtm_solve_options_init();
    vrtm_array a = sheet_positions(pose);
    vrtm_job job;
    int most = 0;
    const int before = threads_left(1);
    memset(&h, 0, sizeof h);
    h.main = pthread_self();
    executor.parallel_for = in_turn;
    executor.spawn = queue;
    executor.user = &h;
    scene made = make(&executor, large / 2), own = make(NULL, large / 2);
    options.threads = 7;
    options.progress = count_threads;
    options.progress_user = &most;
    succeeds("solve on a host's threads", vrtm_asset_solve(made.asset, &a, &options));
    succeeds("fetch on a host's threads", fetch_map(made.tile, map));
    check_that(h.loops >= 2 && h.others == 0, "the host's loop was used", "");
    check_that(most == before, "no thread was started", "");
    succeeds("solve on own threads", vrtm_asset_solve(own.asset, &a, NULL));
    succeeds("fetch on own threads", fetch_map(own.tile, first));
    check_that(same(first, map), "with the same bits", "");

    a = sheet_positions(other);
    succeeds("own threads solve another pose", vrtm_asset_solve(own.asset, &a, NULL));
    succeeds("and fetch it", fetch_map(own.tile, second));
    succeeds("a job goes to the host's queue", vrtm_asset_submit(made.asset, &a, NULL, &job));
    check_that(h.queued == 1, "once", "");
    fails("nobody has begun it", vrtm_job_wait(job, 20), VRTM_ERROR_TIMEOUT, "not done yet");
    h.task[0](h.data[0], 0);
    succeeds("now it is done", vrtm_job_wait(job, 0));
    check_that(fetch_map(made.tile, map) == VRTM_OK && same(second, map), "with the same bits again", "");
    succeeds("destroy it", vrtm_job_destroy(job));

    succeeds("another job", vrtm_asset_submit(made.asset, &a, NULL, &job));
    succeeds("who waits without end does it", vrtm_job_wait(job, VRTM_FOREVER));
    succeeds("destroy it", vrtm_job_destroy(job));
    h.task[1](h.data[1], 0);
    succeeds("a third job", vrtm_asset_submit(made.asset, &a, NULL, &job));
    succeeds("is cancelled before it began", vrtm_job_cancel(job));
    fails("and is over", vrtm_job_wait(job, 0), VRTM_ERROR_CANCELLED, "cancelled");
    succeeds("the asset is free", vrtm_asset_solve(made.asset, &a, NULL));
    succeeds("destroy it", vrtm_job_destroy(job));
    succeeds("a fourth job", vrtm_asset_submit(made.asset, &a, NULL, &job));
    newer n = {made.asset, {0}, VRTM_OK};
    replace(&n);
    fails("is replaced before it began", vrtm_job_wait(job, 0), VRTM_ERROR_CANCELLED, "cancelled");
    succeeds("destroy it", vrtm_job_destroy(job));
    succeeds("cancel the asset's solve", vrtm_asset_cancel(made.asset));
    fails("ends one that has not begun", vrtm_job_wait(n.job, 0), VRTM_ERROR_CANCELLED, "cancelled");
    succeeds("destroy that", vrtm_job_destroy(n.job));
    succeeds("a sixth job", vrtm_asset_submit(made.asset, &a, NULL, &job));
    succeeds("is destroyed before it began", vrtm_job_destroy(job));
    for (int k = 2; k < h.queued; ++k) {
        h.task[k](h.data[k], 0);
    }
    check_that(threads_left(before) == before, "no thread is left", "");
    end(made);
    end(own);
}

int main(void)
{
    /* A solve that never comes to the gate would be waited for without end. */
    platform_end_after(240);
    sheet_make(&s);
    sheet_pose(&s, 4, pose);
    sheet_pose(&s, 9, other);
    plain_jobs();
    newest_wins(0);
    newest_wins(1);
    progress_and_cancelling();
    a_host_s_threads();
    return finish();
}
