/* The forms of vrtm.hpp that throw: each gives what the other form gives, and throws what that one returns. */

#include "check.h"
#include "vrtm.hpp"

#include <chrono>
#include <cstring>
#include <vector>

namespace {

sheet s;
double pose[VERTICES][4];

/* Expects that `call` throws this error, and that its message contains `text`. */
template <class Call> void throws(const char *what, vrtm::Code code, const char *text, Call call)
{
    try {
        call();
        check_that(0, what, "nothing was thrown");
    } catch (const vrtm::Error &error) {
        check_that(error.code() == code && std::strstr(error.what(), text) != nullptr, what, error.what());
    }
}

vrtm::Mesh quads()
{
    const vrtm::Indices corners(s.indices, CORNERS), counts(s.counts, FACES);
    vrtm::Mesh mesh(vrtm::Array(s.points, VERTICES), corners);
    mesh.uvs(vrtm::Array(s.uvs, VERTICES)).uv_indices(corners).face_counts(counts);
    return mesh;
}

vrtm::Image rigidity() { return {&s.rigidity[0][0], MAP, MAP}; }

void everything_works()
{
    const vrtm::Device device = vrtm::Device::create(vrtm::DeviceDesc().set(vrtm::Backend::cpu));
    check_that(vrtm::Backend(device.info().backend) == vrtm::Backend::cpu, "a device", "");
    check_that(vrtm::adapters().size() == vrtm::try_adapters()->size(), "adapters", "");
    const vrtm::Mesh mesh = quads();
    const vrtm_mesh_desc c = mesh.c();
    check_that(vrtm::Asset::create(device, c).info().corners == CORNERS, "an asset in the words of C", "");
    const vrtm::Asset asset = vrtm::Asset::create(device, mesh);
    const vrtm::Tile tile = asset.find_tile(1001);
    check_that(asset.tile_count() == 1 && asset.tiles().at(0) == tile && asset.tile(0) == tile, "its tiles", "");
    check_that(tile.udim() == 1001 && tile.uv_set() == 0, "their place", "");
    tile.set_rigidity(rigidity());
    tile.update_rigidity(rigidity(), 3, 4, 5, 6);
    tile.set_mask(rigidity());
    tile.set_mask(nullptr);
    vrtm::TileSettings settings = tile.settings();
    settings.room = 0.2f;
    tile.set_settings(settings);
    check_that(tile.settings().room == 0.2f, "settings", "");
    tile.set_settings(nullptr);
    check_that(tile.info().udim == 1001 && tile.estimate().movable_nodes == tile.info().movable_nodes, "its data", "");
    const std::vector<unsigned char> saved = tile.save();
    std::vector<unsigned char> again(tile.save(nullptr, 0));
    check_that(tile.save(again.data(), again.size()) == saved.size() && again == saved, "a saved tile", "");
    tile.load(saved);
    tile.load(saved.data(), saved.size());

    std::vector<float> map(2 * MAP * MAP), fetched(map.size()), part(2), corners(2 * CORNERS);
    asset.solve({pose, VERTICES});
    tile.fetch(vrtm::FetchKind::redirection, {fetched.data(), MAP, MAP});
    tile.fetch_part(vrtm::FetchKind::redirection, {part.data(), 1, 1}, 30, 30, MAP, MAP);
    check_that(tile.inspect_map({MAP, MAP}).folds == 0, "a map is looked at", "");
    asset.redirect({pose, VERTICES}, {{tile, {map.data(), MAP, MAP}}});
    check_that(map == fetched && part[0] == map[2 * (30 * MAP + 30)], "solve and redirect", "");
    asset.corner_uvs(corners.data(), CORNERS);
    check_that(asset.corner_uvs() == corners, "corner UVs", "");
    check_that(asset.report().tiles == 1 && tile.report().kept == 0, "reports", "");
    tile.freeze(true);
    asset.solve({s.points, VERTICES});
    check_that(tile.report().kept == 1, "a frozen tile", "");
    tile.freeze(false);
    vrtm::Job job = asset.submit({s.points, VERTICES});
    job.wait();
    check_that(job.wait_for(std::chrono::seconds(1)) && job.progress().state == vrtm::JobState::done, "a job", "");
    job.cancel();
    asset.cancel();
    job.reset();
    std::vector<float> ones(VERTICES, 1);
    asset.set_vertex_rigidity({ones.data(), VERTICES});
    asset.set_vertex_rigidity(nullptr);
    asset.set_vertex_mask({ones.data(), VERTICES});
    asset.set_vertex_mask(nullptr);
    tile.set_rigidity(nullptr);
    asset.solve({pose, VERTICES});
    check_that(tile.report().charts_active == 0, "no rigidity", "");
    const vrtm::Refinement refinement = asset.refine();
    refinement.extend();
    check_that(refinement.info().faces == FACES && refinement.pattern().corner_vertices.size() == CORNERS,
               "nothing to refine", "");
    vrtm_refinement_pattern pattern = vrtm_refinement_pattern_init();
    pattern.vertex_count = VERTICES, pattern.face_count = FACES, pattern.corner_count = CORNERS;
    refinement.pattern(pattern);
    refinement.corner_uvs(corners.data(), CORNERS);
    check_that(refinement.corner_uvs() == corners && corners == asset.corner_uvs(), "its corner UVs", "");
    vrtm::Result<vrtm_tile_report_data> report = tile.try_report();
    check_that(report.value().udim == 1001 && std::move(report).value().udim == 1001, "a result's value", "");
}

void everything_throws()
{
    using vrtm::Code;
    vrtm::DeviceDesc desc;
    desc.threads = 5000;
    throws("Device::create", Code::invalid_argument, "threads", [&] { vrtm::Device::create(desc); });
    throws("Device::info", Code::invalid_handle, "device", [] { vrtm::Device().info(); });
    throws("Asset::create", Code::invalid_handle, "device", [] { vrtm::Asset::create(vrtm::Device(), quads()); });
    const vrtm::Mesh mesh = quads();
    const vrtm_mesh_desc c = mesh.c();
    throws("Asset::create of C", Code::invalid_handle, "device", [&] { vrtm::Asset::create(vrtm::Device(), c); });

    const vrtm::Asset asset;
    float pair[2];
#define NONE(call) throws(#call, Code::invalid_handle, "asset", [&] { static_cast<void>(asset.call); });
    NONE(info())
    NONE(tile_count())
    NONE(tile(0))
    NONE(tiles())
    NONE(find_tile(1001))
    NONE(set_vertex_rigidity(nullptr))
    NONE(set_vertex_rigidity({pair, 2}))
    NONE(set_vertex_mask(nullptr))
    NONE(set_vertex_mask({pair, 2}))
    NONE(solve({pose, VERTICES}))
    NONE(redirect({pose, VERTICES}, {}))
    NONE(cancel())
    NONE(submit({pose, VERTICES}))
    NONE(corner_uvs())
    NONE(corner_uvs(pair, 1))
    NONE(refine())
    NONE(report())
#undef NONE

    const vrtm::Refinement refinement;
    const vrtm_refinement_pattern pattern = vrtm_refinement_pattern_init();
#define NONE(call) throws(#call, Code::invalid_handle, "refinement", [&] { static_cast<void>(refinement.call); });
    NONE(extend())
    NONE(info())
    NONE(pattern())
    NONE(pattern(pattern))
    NONE(corner_uvs())
    NONE(corner_uvs(pair, 1))
#undef NONE

    const vrtm::Tile tile;
    const std::vector<unsigned char> bytes(8);
#define NONE(call) throws(#call, Code::invalid_handle, "tile", [&] { static_cast<void>(tile.call); });
    NONE(info())
    NONE(set_rigidity(nullptr))
    NONE(set_rigidity(rigidity()))
    NONE(update_rigidity(rigidity(), 0, 0, 1, 1))
    NONE(set_mask(nullptr))
    NONE(set_mask(rigidity()))
    NONE(set_settings(nullptr))
    NONE(set_settings(vrtm::TileSettings()))
    NONE(settings())
    NONE(udim())
    NONE(uv_set())
    NONE(freeze(true))
    NONE(estimate())
    NONE(save())
    NONE(save(nullptr, 0))
    NONE(load(bytes))
    NONE(load(bytes.data(), bytes.size()))
    NONE(inspect_map({1, 1}))
    NONE(fetch(vrtm::FetchKind::warp, {pair, 1, 1}))
    NONE(fetch_part(vrtm::FetchKind::warp, {pair, 1, 1}, 0, 0, 2, 2))
    NONE(fetch_external(vrtm::FetchKind::redirection, vrtm::ExternalImage(0, 8, 0, 1, 1)))
    NONE(report())
#undef NONE

    const vrtm::Job job;
#define NONE(call) throws(#call, Code::invalid_handle, "job", [&] { static_cast<void>(job.call); });
    NONE(wait())
    NONE(wait_for(std::chrono::seconds(1)))
    NONE(progress())
    NONE(cancel())
#undef NONE
}

/* A timeout is no error, and a cancelled job is one. */
void a_job_that_is_cancelled()
{
    const vrtm::Device device = vrtm::Device::create(vrtm::DeviceDesc().set(vrtm::Backend::cpu));
    const vrtm::Asset asset = vrtm::Asset::create(device, quads());
    asset.find_tile(1001).set_rigidity(rigidity());
    vrtm::TileSettings settings;
    settings.grid_width = settings.grid_height = 2048;
    asset.find_tile(1001).set_settings(settings);
    const vrtm::Job job = asset.submit({pose, VERTICES});
    check_that(!job.wait_for(std::chrono::microseconds(1)), "a job that is not done", "");
    job.cancel();
    throws("a job that was cancelled", vrtm::Code::cancelled, "cancelled", [&] { job.wait(); });
    throws("wait_for", vrtm::Code::cancelled, "cancelled", [&] { job.wait_for(std::chrono::hours(1)); });
}

} // namespace

int main()
{
    sheet_make(&s);
    sheet_pose(&s, 5, pose);
    try {
        everything_works();
        everything_throws();
        a_job_that_is_cancelled();
    } catch (const vrtm::Error &error) {
        check_that(0, "no exception", error.what());
    }
    return finish();
}
