/*
 * What a sanitizer must find, so that a run in which it finds nothing means something. With the argument "reads_beyond" the
 * host claims one position more than its memory holds, which the library reads; with "leaks" it drops what it allocated.
 */

#include "check.h"

#include <stdint.h>

static void reads_beyond(void)
{
    static sheet s;
    vrtm_device device;
    vrtm_asset asset;
    vrtm_device_desc desc = vrtm_device_desc_init();
    sheet_desc d;
    const size_t bytes = (VERTICES - 1) * sizeof s.points[0];
    double *points = malloc(bytes);
    sheet_make(&s);
    sheet_describe(&s, &d);
    memcpy(points, s.points, bytes);
    d.positions.data = points;
    desc.backend = VRTM_BACKEND_CPU;
    succeeds("a device", vrtm_device_create(&desc, &device));
    succeeds("an asset", vrtm_asset_create(device, &d.mesh, &asset));
    free(points);
}

static void leaks(void)
{
    static void *volatile kept;
    kept = malloc(12345);
    kept = NULL;
}

int main(int count, char **arguments)
{
    if (count == 2 && strcmp(arguments[1], "reads_beyond") == 0) {
        reads_beyond();
    } else if (count == 2 && strcmp(arguments[1], "leaks") == 0) {
        leaks();
    }
    return finish();
}
