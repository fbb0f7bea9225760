/* Solves a sheet on one thread so often as the argument says, each time another pose, and prints the updates of nodes. */

#include "check.h"

int main(int count, char **arguments)
{
    static sheet s;
    static double pose[VERTICES][4];
    const int solves = count > 1 ? atoi(arguments[1]) : 1;
    unsigned long long updates = 0;
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_tile_settings settings = vrtm_tile_settings_init();
    vrtm_tile_report report = vrtm_tile_report_init();
    vrtm_device device;
    vrtm_asset asset;
    vrtm_tile tile;
    sheet_desc d;
    sheet_make(&s);
    sheet_describe(&s, &d);
    vrtm_image rigidity = sheet_rigidity(&s);
    desc.backend = VRTM_BACKEND_CPU;
    desc.threads = 1;
    settings.grid_width = settings.grid_height = 256;
    int bad = vrtm_device_create(&desc, &device) || vrtm_asset_create(device, &d.mesh, &asset) ||
              find_udim(asset, 1001, &tile) || vrtm_tile_set_rigidity(tile, &rigidity) ||
              vrtm_tile_set_settings(tile, &settings);
    for (int k = 0; k < solves && !bad; ++k) {
        const vrtm_array positions = sheet_positions(pose);
        sheet_pose(&s, 4 + k, pose);
        bad = vrtm_asset_solve(asset, &positions, NULL) || vrtm_tile_get_report(tile, &report);
        updates += report.node_updates;
    }
    puts(bad ? vrtm_last_error() : "");
    printf("%llu\n", updates);
    return bad;
}
