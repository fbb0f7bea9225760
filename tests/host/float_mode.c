/* A host that has changed the processor's floating-point mode gets the same bits, no traps, and its own mode back. */

#if defined(__linux__)
#define _GNU_SOURCE
#endif

#include "check.h"

#include <fenv.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

static sheet s;
static double pose[VERTICES][4];

/* Solves frame 5 on a new asset and fetches the redirection. */
static void solve(float *map)
{
    scene made;
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_array positions = sheet_positions(pose);
    vrtm_solve_options options = vrtm_solve_options_init();
    desc.backend = VRTM_BACKEND_CPU;
    options.measure = 1;
    if (went_well("a scene", scene_make(&made, &s, &desc, 0))) {
        for (int quality = 0; quality < 2; ++quality) {
            options.quality = quality;
            succeeds("a solve", vrtm_asset_solve(made.asset, &positions, &options));
        }
        succeeds("a fetch", fetch_map(made.tile, map));
        went_well("its end", scene_end(&made));
    }
}

int main(void)
{
    static float expected[2 * MAP * MAP], map[2 * MAP * MAP];
    const int modes[] = {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO};
    const char *names[] = {"rounding up", "rounding down", "rounding toward zero"};
    sheet_make(&s);
    sheet_pose(&s, 5, pose);
    solve(expected);
    for (int k = 0; k < 3; ++k) {
        fesetround(modes[k]);
        solve(map);
        const int mode = fegetround();
        fesetround(FE_TONEAREST);
        check_that(memcmp(map, expected, sizeof map) == 0, names[k], "other bits");
        check_that(mode == modes[k], "the host's rounding stays", "it does not");
    }
#if defined(__x86_64__)
    /* Operands and results that are denormal count as zero. */
    const unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040);
    solve(map);
    const unsigned after = _mm_getcsr();
    _mm_setcsr(before);
    check_that(memcmp(map, expected, sizeof map) == 0, "flushing to zero", "other bits");
    check_that(after == (before | 0x8040), "the host's flushing stays", "it does not");
#endif
#if defined(__linux__) && defined(__x86_64__)
    feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW | FE_UNDERFLOW | FE_INEXACT);
    vrtm_tile none = {0};
    const vrtm_status status = vrtm_tile_set_rigidity(none, NULL);
    solve(map);
    const int traps = fedisableexcept(FE_ALL_EXCEPT);
    check_that(status == VRTM_ERROR_INVALID_HANDLE, "a failed call", vrtm_status_string(status));
    check_that(memcmp(map, expected, sizeof map) == 0, "traps", "other bits");
    check_that(traps == (FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW | FE_UNDERFLOW | FE_INEXACT), "the host's traps stay", "they do not");
#endif
    return finish();
}
