/*
 * How fine a grid painted features need: discs on a sheet that is pushed through from below, solved on grids of several
 * sizes. A disc's error is how much its diameters are longer or shorter than at rest, on the posed surface, where its
 * texels are seen. The table in docs/hosts.md is printed with VRTM_PRINT_GRIDS=1.
 */

#include "check.h"

#include "vrtm.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace {

constexpr int cells_of_mesh = 96, texels = 1024;
constexpr double pi = 3.14159265358979323846;
using Point = std::array<double, 3>;

/* A point of the sheet, at rest or pushed through by nine bulges. */
Point surface(double u, double v, bool posed)
{
    Point point = {10 * u, 10 * v, 0};
    for (int bulge = 0; posed && bulge < 9; ++bulge) {
        const double dx = point[0] - 1.7 - 3.3 * (bulge % 3), dy = point[1] - 1.7 - 3.3 * (bulge / 3);
        point[2] += 1.6 * std::exp(-(dx * dx + dy * dy) / 0.8);
    }
    return point;
}

double distance(const Point &a, const Point &b)
{
    return std::sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

/* A sheet with `discs` by `discs` discs, whose diameters are 0.6 of their distance. */
struct Scene {
    std::vector<double> rest, posed;
    std::vector<float> uvs;
    std::vector<std::uint32_t> indices;
    std::vector<std::uint8_t> rigidity;
    int discs;

    explicit Scene(int discs_per_side) : rigidity(std::size_t(texels) * texels), discs(discs_per_side)
    {
        const std::uint32_t side = cells_of_mesh + 1;
        for (std::uint32_t k = 0; k < side * side; ++k) {
            const double u = double(k % side) / cells_of_mesh, v = double(k / side) / cells_of_mesh;
            const Point a = surface(u, v, false), b = surface(u, v, true);
            rest.insert(rest.end(), a.begin(), a.end());
            posed.insert(posed.end(), b.begin(), b.end());
            uvs.insert(uvs.end(), {float(u), float(v)});
            if (k % side != cells_of_mesh && k / side != cells_of_mesh) {
                indices.insert(indices.end(), {k, k + 1, k + side + 1, k, k + side + 1, k + side});
            }
        }
        for (std::size_t k = 0; k < rigidity.size(); ++k) {
            const double x = double(k % texels) * discs / texels, y = double(k / texels) * discs / texels;
            rigidity[k] = std::hypot(x - std::floor(x) - 0.5, y - std::floor(y) - 0.5) < 0.3 ? 255 : 0;
        }
    }
};

/* Where a point of the texture is seen: the warp's nodes, between them bilinear. */
std::array<double, 2> warped(const std::vector<float> &warp, int side, double u, double v)
{
    const double x = u * (side - 1), y = v * (side - 1), fx = x - std::floor(x), fy = y - std::floor(y);
    const std::size_t row = 2 * std::size_t(side), at = std::size_t(y) * row + 2 * std::size_t(x), below = at + row;
    std::array<double, 2> seen;
    for (std::size_t k = 0; k < 2; ++k) {
        seen[k] = (1 - fy) * ((1 - fx) * double(warp[at + k]) + fx * double(warp[at + 2 + k])) +
                  fy * ((1 - fx) * double(warp[below + k]) + fx * double(warp[below + 2 + k]));
    }
    return seen;
}

/* The errors of all discs but those at the border, root mean square: with the mesh's own UVs, and with the warp. */
std::array<double, 2> errors(const vrtm::Device &device, const Scene &scene, std::uint32_t grid)
{
    vrtm::Mesh mesh(vrtm::Array::of<3>(scene.rest), scene.indices);
    mesh.uvs(vrtm::Array::of<2>(scene.uvs)).uv_indices(scene.indices);
    const vrtm::Asset asset = vrtm::Asset::create(device, mesh).value();
    const vrtm::Tile tile = asset.tile(0).value();
    tile.set_rigidity(vrtm::Image(scene.rigidity, texels, texels).origin(vrtm::Origin::bottom)).value();
    vrtm::TileSettings settings;
    settings.grid_width = settings.grid_height = grid;
    tile.set_settings(settings).value();
    asset.solve(vrtm::Array::of<3>(scene.posed)).value();
    const int side = int(grid) + 1;
    std::vector<float> warp(2 * std::size_t(side) * std::size_t(side));
    const vrtm::ImageOut image(warp, std::uint32_t(side), std::uint32_t(side));
    tile.fetch(vrtm::FetchKind::warp, vrtm::ImageOut(image).origin(vrtm::Origin::bottom)).value();

    std::array<double, 2> sums = {};
    int count = 0;
    for (int disc = 0; disc < scene.discs * scene.discs; ++disc) {
        const int i = disc % scene.discs, j = disc / scene.discs;
        if (i == 0 || j == 0 || i == scene.discs - 1 || j == scene.discs - 1) {
            continue;
        }
        for (int diameter = 0; diameter < 4; ++diameter, ++count) {
            const double du = 0.27 * std::cos(diameter * pi / 4), dv = 0.27 * std::sin(diameter * pi / 4);
            std::array<Point, 2> at_rest, own, moved;
            for (std::size_t end = 0; end < 2; ++end) {
                const double sign = end == 0 ? 1 : -1;
                const double u = (i + 0.5 + sign * du) / scene.discs, v = (j + 0.5 + sign * dv) / scene.discs;
                const std::array<double, 2> seen = warped(warp, side, u, v);
                at_rest[end] = surface(u, v, false);
                own[end] = surface(u, v, true);
                moved[end] = surface(seen[0], seen[1], true);
            }
            const double length = distance(at_rest[0], at_rest[1]);
            sums[0] += std::pow(distance(own[0], own[1]) / length - 1, 2);
            sums[1] += std::pow(distance(moved[0], moved[1]) / length - 1, 2);
        }
    }
    return {std::sqrt(sums[0] / count), std::sqrt(sums[1] / count)};
}

} // namespace

int main()
{
    const vrtm::Device device = vrtm::Device::create(vrtm::DeviceDesc().set(vrtm::Backend::cpu)).value();
    const Scene scene(32);
    if (std::getenv("VRTM_PRINT_GRIDS") != nullptr) {
        for (std::uint32_t grid = 64; grid <= 1024; grid *= 2) {
            const std::array<double, 2> e = errors(device, scene, grid);
            const double across = 0.6 * grid / scene.discs, between = 0.4 * grid / scene.discs;
            std::printf("%u: %.1f cells across, %.1f between, %.3f to %.4f\n", grid, across, between, e[0], e[1]);
        }
    }
    const std::array<double, 2> coarse = errors(device, scene, 128), enough = errors(device, scene, 256);
    const std::string detail = std::to_string(coarse[1]) + ", " + std::to_string(enough[1]);
    check_that(coarse[0] > 0.25, "discs are strained by a quarter", std::to_string(coarse[0]).c_str());
    check_that(coarse[1] > 0.1, "two cells across a disc do not keep its shape", detail.c_str());
    check_that(enough[1] < 0.015, "five cells across, and three between two, do", detail.c_str());
    return finish();
}
