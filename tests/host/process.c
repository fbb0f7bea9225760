/*
 * The process around the library, on the CPU: forks, timers whose signals hit solves, and the host's state.
 * Results keep their bits, and everything that belongs to the host is as it was.
 */

#define _GNU_SOURCE
#include "check.h"

#include <errno.h>
#include <fenv.h>
#include <locale.h>
#include <pthread.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

enum { TEXELS = 2 * MAP * MAP };

static sheet s;
static double poses[8][VERTICES][4];
static float expected[TEXELS];

static const char *make(scene *m, uint32_t threads)
{
    vrtm_device_desc desc = vrtm_device_desc_init();
    desc.backend = VRTM_BACKEND_CPU;
    desc.threads = threads;
    return scene_make(m, &s, &desc, 128);
}

static const char *solve(const scene *m, int frame, float *map)
{
    vrtm_array positions = sheet_positions(poses[frame]);
    TRY(vrtm_asset_solve(m->asset, &positions, NULL))
    TRY(fetch_map(m->tile, map))
    return NULL;
}

/* Frame 5, after another one, so that nothing is reused. */
static const char *same_bits(const scene *m)
{
    float *map = malloc(sizeof expected);
    const char *wrong = map == NULL ? "no memory" : solve(m, 1, map);
    if (wrong == NULL) {
        wrong = solve(m, 5, map);
    }
    if (wrong == NULL && memcmp(map, expected, sizeof expected) != 0) {
        wrong = "the result has other bits";
    }
    free(map);
    return wrong;
}

static const char *all(uint32_t threads)
{
    scene m;
    const char *wrong = make(&m, threads);
    if (wrong == NULL) {
        wrong = same_bits(&m);
    }
    return wrong != NULL ? wrong : scene_end(&m);
}

/* Waits for a child, at most a minute, and says whether it ended with 0. */
static int ended_well(pid_t child)
{
    for (int k = 0; k < 6000; ++k) {
        int status = 0;
        if (waitpid(child, &status, WNOHANG) == child) {
            return WIFEXITED(status) && WEXITSTATUS(status) == 0;
        }
        usleep(10000);
    }
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    return 0;
}

/* A fork between calls: both processes use the device and the asset from before it, and new ones. */
static void fork_between_calls(const scene *m)
{
    for (uint32_t threads = 1; threads <= 2; ++threads) {
        const pid_t child = fork();
        if (child == 0) {
            const char *wrong = same_bits(m);
            wrong = wrong != NULL ? wrong : all(threads);
            wrong = wrong != NULL ? wrong : scene_end(m);
            _exit(wrong != NULL);
        }
        went_well("the parent solves beside its child", same_bits(m));
        check_that(ended_well(child), "the child of a fork solves, and destroys", "it does not");
        went_well("its parent's handles are still good", same_bits(m));
    }
}

static volatile int stop;

static void *solve_on(void *m)
{
    const char *wrong = NULL;
    while (!stop && wrong == NULL) {
        wrong = same_bits(m);
    }
    return (void *)wrong;
}

/* Forks while another thread solves: the child does what POSIX allows it, and the solves go on. */
static void fork_during_calls(scene *m)
{
    pthread_t thread;
    void *wrong = NULL;
    int bad = 0;
    stop = 0;
    check_that(pthread_create(&thread, NULL, solve_on, m) == 0, "a thread that solves", "refused");
    for (int k = 0; k < 40; ++k) {
        const pid_t child = fork();
        if (child == 0) {
            if (k % 2) {
                execl("/bin/true", "true", (char *)NULL);
            }
            _exit(k % 2);
        }
        usleep(2000);
        bad += !ended_well(child);
    }
    stop = 1;
    pthread_join(thread, &wrong);
    check_that(bad == 0, "children of forks during solves exec and exit", "not all");
    went_well("the solves beside the forks have the same bits", wrong);
}

static pthread_t host_threads[2];
static volatile sig_atomic_t ticks, foreign;

static void tick(int signal)
{
    const int before = errno;
    (void)signal;
    ticks += 1;
    foreign += !pthread_equal(pthread_self(), host_threads[0]) && !pthread_equal(pthread_self(), host_threads[1]);
    errno = before;
}

static void timers(const scene *m)
{
    for (int restart = 0; restart < 2; ++restart) {
        struct sigaction action, before;
        struct itimerval every = {{0, 300}, {0, 300}}, never = {{0, 0}, {0, 0}};
        const char *wrong = NULL;
        memset(&action, 0, sizeof action);
        action.sa_handler = tick;
        action.sa_flags = restart ? SA_RESTART : 0;
        ticks = foreign = 0;
        host_threads[0] = host_threads[1] = pthread_self();
        sigaction(SIGALRM, &action, &before);
        setitimer(ITIMER_REAL, &every, NULL);
        for (int k = 0; (k < 30 || ticks < 100) && wrong == NULL; ++k) {
            wrong = k % 5 ? same_bits(m) : all(2);
        }
        setitimer(ITIMER_REAL, &never, NULL);
        sigaction(SIGALRM, &before, NULL);
        went_well(restart ? "solves under a timer that restarts calls" : "solves under a timer that interrupts calls", wrong);
        check_that(ticks >= 100, "which rang", "too rarely");
        check_that(foreign == 0, "on the host's thread alone", "a handler ran on a thread of the library");
    }
}

/* What belongs to the host, as bytes to compare. */
typedef struct {
    sigset_t mask;
    struct {
        void (*handler)(int);
        int flags;
    } actions[32];
    char folder[512], locale[64];
    mode_t umask;
    int rounding, exceptions, variables;
    struct itimerval timer;
} state;

extern char **environ;

static void read_state(state *now)
{
    memset(now, 0, sizeof *now);
    pthread_sigmask(SIG_BLOCK, NULL, &now->mask);
    for (int signal = 1; signal < 32; ++signal) {
        struct sigaction action;
        if (sigaction(signal, NULL, &action) == 0) {
            now->actions[signal].handler = action.sa_handler;
            now->actions[signal].flags = action.sa_flags;
        }
    }
    if (getcwd(now->folder, sizeof now->folder) == NULL) {
        now->folder[0] = 0;
    }
    snprintf(now->locale, sizeof now->locale, "%s", setlocale(LC_ALL, NULL));
    now->umask = umask(0);
    umask(now->umask);
    now->rounding = fegetround();
    now->exceptions = fetestexcept(FE_ALL_EXCEPT);
    while (environ[now->variables] != NULL) {
        now->variables += 1;
    }
    getitimer(ITIMER_REAL, &now->timer);
}

static void host_state(void)
{
    static state before, after;
    sigset_t some, none;
    sigemptyset(&none);
    sigemptyset(&some);
    sigaddset(&some, SIGUSR1);
    pthread_sigmask(SIG_BLOCK, &some, NULL);
    feclearexcept(FE_ALL_EXCEPT);
    feraiseexcept(FE_INEXACT);
    srand(7);
    const int first = rand();
    srand(7);
    read_state(&before);
    went_well("all calls", all(2));
    scene nothing = {{0}, {0}, {0}};
    check_that(vrtm_device_destroy(nothing.device) == VRTM_ERROR_INVALID_HANDLE, "and one that fails", "");
    read_state(&after);
    check_that(memcmp(&before.mask, &after.mask, sizeof before.mask) == 0, "the signal mask is as it was", "changed");
    check_that(memcmp(before.actions, after.actions, sizeof before.actions) == 0, "so are signal handlers", "changed");
    check_that(before.rounding == after.rounding && before.exceptions == after.exceptions, "the floating-point state",
               "changed");
    check_that(before.umask == after.umask && strcmp(before.folder, after.folder) == 0 &&
                   strcmp(before.locale, after.locale) == 0 && before.variables == after.variables &&
                   memcmp(&before.timer, &after.timer, sizeof before.timer) == 0,
               "the folder, umask, locale, environment and timer", "changed");
    check_that(rand() == first, "and the C library's random numbers", "changed");
    pthread_sigmask(SIG_SETMASK, &none, NULL);
}

int main(void)
{
    scene m;
    sheet_make(&s);
    for (int frame = 0; frame < 8; ++frame) {
        sheet_pose(&s, frame, poses[frame]);
    }
    went_well("a model", make(&m, 2));
    went_well("its result", solve(&m, 5, expected));
    went_well("again", same_bits(&m));
    host_state();
    fork_between_calls(&m);
    fork_during_calls(&m);
    timers(&m);
    went_well("its end", scene_end(&m));
    return finish();
}
