#include <stdio.h>
#include "vrtm.h"

#define TRY(call) if ((call) != VRTM_OK) return puts(vrtm_last_error()), 1

int main(void)
{
    static float rest[] = {0,0,0, 1,0,0, 2,0,0, 0,1,0, 1,1,0, 2,1,0}, pose[] = {0,0,0, 1.3f,0,0, 2,0,0, 0,1,0, 1.3f,1,0, 2,1,0};
    static float pairs[] = {0,0, 0.5f,0, 1,0, 0,1, 0.5f,1, 1,1}, map[256 * 256 * 2];
    static uint32_t quads[] = {0,1,4,3, 1,2,5,4}, counts[] = {4, 4};
    static uint8_t painted[16] = {0,0,0,0, 0,255,0,0, 0,255,0,0, 0,0,0,0}; /* 255: keeps its shape */
    vrtm_array points = vrtm_array_init(), uvs = vrtm_array_init();
    points.data = rest; points.count = 6; uvs.data = pairs; uvs.count = 6;
    vrtm_mesh_desc mesh = vrtm_mesh_desc_init();
    mesh.positions = &points; mesh.face_counts = counts; mesh.face_count = 2; mesh.uvs = &uvs;
    mesh.indices = mesh.uv_indices = quads; mesh.index_count = mesh.uv_index_count = 8;
    vrtm_image rigidity = vrtm_image_init();
    rigidity.data = painted; rigidity.format = VRTM_PIXEL_U8; rigidity.width = rigidity.height = 4;
    vrtm_image_out out = vrtm_image_out_init();
    out.data = map; out.width = out.height = 256; /* RG f32 */
    vrtm_fetch fetch = vrtm_fetch_init();
    fetch.image = &out;

    vrtm_device device;
    vrtm_asset asset;
    TRY(vrtm_device_create(NULL, &device));
    TRY(vrtm_asset_create(device, &mesh, &asset));
    TRY(vrtm_asset_find_tile(asset, 1001, &fetch.tile));
    TRY(vrtm_tile_set_rigidity(fetch.tile, &rigidity));
    points.data = pose; /* from here on, for every frame */
    TRY(vrtm_asset_redirect(asset, &points, NULL, &fetch, 1));
    printf("texel (64, 64) samples the texture at %.3f %.3f\n", map[2 * (64 * 256 + 64)], map[2 * (64 * 256 + 64) + 1]);
    TRY(vrtm_asset_destroy(asset));
    TRY(vrtm_device_destroy(device));
    return 0;
}
