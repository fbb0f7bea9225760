/*
 * A farm: one machine prepares the tiles and writes them to files, others load them and compute frames of their own, in
 * any order, with memory that is known before; a viewport's user sees drafts. The code that docs/hosts.md shows.
 */

#include "check.h"
#include "vrtm.hpp"

#include <cstdio>
#include <string>
#include <vector>

namespace {

using Bytes = std::vector<unsigned char>;
using Band = std::vector<float>;

sheet s;

vrtm::Asset make(const vrtm::Device &device)
{
    const vrtm::Indices corners(s.indices, CORNERS), counts(s.counts, FACES);
    vrtm::Mesh mesh(vrtm::Array(s.points, VERTICES), corners);
    mesh.uvs(vrtm::Array(s.uvs, VERTICES)).uv_indices(corners).face_counts(counts);
    vrtm::Asset asset = vrtm::Asset::create(device, mesh).value();
    const vrtm::Tile tile = asset.find_tile(1001).value();
    tile.set_rigidity({&s.rigidity[0][0], MAP, MAP}).value();
    vrtm::TileSettings settings;
    settings.grid_width = settings.grid_height = 256;
    tile.set_settings(settings).value();
    return asset;
}

/* On the first machine: what the others need not do again. */
std::vector<Bytes> prepare(const vrtm::Asset &asset)
{
    std::vector<Bytes> saved;
    for (const vrtm::Tile tile : asset.tiles().value()) {
        saved.push_back(tile.save().value());
    }
    return saved;
}

/* On the others. A file of another version, mesh, map or setting is refused: the tile is then prepared here. */
int load(const vrtm::Asset &asset, const std::vector<Bytes> &saved)
{
    int refused = 0;
    const std::vector<vrtm::Tile> tiles = asset.tiles().value();
    for (std::size_t i = 0; i < tiles.size() && i < saved.size(); ++i) {
        refused += tiles[i].load(saved[i]) ? 0 : 1;
    }
    return refused;
}

/* Whether the solve of all tiles fits into so many bytes. */
bool fits(const vrtm::Asset &asset, std::uint64_t bytes)
{
    std::uint64_t prepared = 0, peak = 0;
    for (const vrtm::Tile tile : asset.tiles().value()) {
        const vrtm_tile_estimate needs = tile.estimate().value();
        prepared += needs.prepared_bytes;
        peak += needs.solving_bytes;
    }
    return prepared + peak <= bytes;
}

/* A frame of the farm: no result is kept while the next one is computed, and the map goes out in bands. */
template <class Write>
void final_frame(const vrtm::Asset &asset, const vrtm::Array &positions, std::uint32_t size, const Write &write)
{
    vrtm::SolveOptions options;
    options.release = VRTM_RELEASE_RESULTS + VRTM_RELEASE_SOLVERS;
    asset.solve(positions, options).value();
    const std::uint32_t rows = 64;
    Band band(2 * std::size_t(size) * rows);
    for (const vrtm::Tile tile : asset.tiles().value()) {
        for (std::uint32_t y = 0; y < size; y += rows) {
            const std::uint32_t height = y + rows < size ? rows : size - y;
            tile.fetch_part(vrtm::FetchKind::redirection, {band.data(), size, height, 2}, 0, y, size, size).value();
            write(tile, y, height, band);
        }
    }
}

/* While the user drags: at once, and from where the last one ended. */
vrtm::SolveOptions dragging()
{
    vrtm::SolveOptions options;
    options.set(vrtm::Quality::draft);
    options.warm = 1;
    options.time_budget_ms = 30;
    return options;
}

Band whole(const vrtm::Asset &asset, const vrtm::Array &positions, std::uint32_t size)
{
    Band map;
    final_frame(asset, positions, size, [&](vrtm::Tile, std::uint32_t, std::uint32_t height, const Band &band) {
        map.insert(map.end(), band.begin(), band.begin() + 2 * std::ptrdiff_t(size) * height);
    });
    return map;
}

} // namespace

int main()
{
    static double pose[12][VERTICES][4];
    sheet_make(&s);
    for (int frame = 0; frame < 12; ++frame) {
        sheet_pose(&s, frame, pose[frame]);
    }
    try {
        const vrtm::Device device = vrtm::Device::create(vrtm::DeviceDesc().set(vrtm::Backend::cpu)).value();
        const vrtm::Asset first = make(device);
        const std::vector<Bytes> saved = prepare(first);
        check_that(!saved.empty() && !saved[0].empty(), "tiles are saved", "");
        std::vector<Band> expected;
        for (const auto &points : pose) {
            expected.push_back(whole(first, {points, VERTICES}, 200));
        }
        check_that(expected[0] != expected[1] && expected[1].size() == 2 * 200 * 200, "frames in order", "");
        Band at_once(2 * 200 * 200);
        first.tile(0).value().fetch(vrtm::FetchKind::redirection, {at_once, 200, 200}).value();
        check_that(at_once == expected.back(), "the bands are the map", "");

        const vrtm::Device other = vrtm::Device::create(vrtm::DeviceDesc().set(vrtm::Backend::cpu)).value();
        const vrtm::Asset worker = make(other);
        check_that(fits(worker, std::uint64_t(1) << 30) && !fits(worker, 1 << 20), "what it takes is known before", "");
        check_that(load(worker, saved) == 0, "another machine loads them", vrtm_last_error());
        bool same = true;
        for (int frame : {7, 2, 11, 2}) {
            same = same && whole(worker, {pose[frame], VERTICES}, 200) == expected[std::size_t(frame)];
        }
        check_that(same, "its frames are the same, in any order", "");
        std::vector<Bytes> damaged = saved;
        damaged[0][damaged[0].size() / 2] ^= 1;
        const vrtm::Asset careful = make(other);
        check_that(load(careful, damaged) == 1, "a damaged file is refused", "");
        check_that(whole(careful, {pose[3], VERTICES}, 200) == expected[3], "and the tile prepared instead", "");

        first.solve({pose[4], VERTICES}, dragging()).value();
        check_that(first.report().value().folds == 0, "a draft while dragging", "");
        check_that(whole(first, {pose[5], VERTICES}, 200) == expected[5], "leaves no trace in the next frame", "");
    } catch (const vrtm::Error &error) {
        check_that(0, "no exception", error.what());
    }
    return finish();
}
