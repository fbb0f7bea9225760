#include <stdio.h>
#include "vrtm.h"

static float map[256 * 256 * 2]; /* u, v: where to sample the texture */

int main(void)
{
    float rest[] = {0,0,0, 1,0,0, 2,0,0, 0,1,0, 1,1,0, 2,1,0};       /* two squares side by side ... */
    float pose[] = {0,0,0, 1.3f,0,0, 2,0,0, 0,1,0, 1.3f,1,0, 2,1,0}; /* ... one stretched, one squashed */
    float pairs[] = {0,0, 0.5f,0, 1,0, 0,1, 0.5f,1, 1,1};
    uint32_t corners[] = {0,1,4, 0,4,3, 1,2,5, 1,5,4};
    uint8_t painted[16] = {0,0,0,0, 0,255,0,0, 0,255,0,0, 0,0,0,0};  /* 255: keeps its shape */
    vrtm_device device;
    vrtm_asset asset;
    vrtm_fetch fetch = vrtm_fetch_init();
    vrtm_array points = vrtm_array_init(), uvs = vrtm_array_init();
    vrtm_mesh_desc mesh = vrtm_mesh_desc_init();
    vrtm_image rigidity = vrtm_image_init();
    vrtm_image_out out = vrtm_image_out_init();
    points.data = rest, points.count = 6, uvs.data = pairs, uvs.count = 6;
    mesh.positions = &points, mesh.uvs = &uvs;
    mesh.indices = mesh.uv_indices = corners, mesh.index_count = mesh.uv_index_count = 12;
    rigidity.data = painted, rigidity.format = VRTM_PIXEL_U8, rigidity.width = rigidity.height = 4;
    out.data = map, out.width = out.height = 256;
    fetch.image = &out;
    if (vrtm_device_create(NULL, &device) || vrtm_asset_create(device, &mesh, &asset) ||
        vrtm_asset_find_tile(asset, &(vrtm_tile_key){.udim = 1001}, &fetch.tile) ||
        vrtm_tile_set_rigidity(fetch.tile, &rigidity))
        return puts(vrtm_last_error()), 1;
    points.data = pose; /* from here on for every frame: positions in, map out */
    if (vrtm_asset_redirect(asset, &points, NULL, &fetch, 1))
        return puts(vrtm_last_error()), 1;
    printf("texel (64, 64) samples the texture at %.3f %.3f\n", map[2 * (64 * 256 + 64)], map[2 * (64 * 256 + 64) + 1]);
    return vrtm_asset_destroy(asset) || vrtm_device_destroy(device);
}
