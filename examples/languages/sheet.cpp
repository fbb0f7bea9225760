// A sheet of two charts with eight painted discs, in 48 poses: a preview in which the newest pose wins, then each pose
// exactly, with its map and a stud. README.md says what is printed.
#include "vrtm.hpp"

#include <cmath>
#include <cstdio>

constexpr int poses = 48, cells = 20, line = cells + 1, texels = 128;
constexpr double radius = 0.15;

struct Point {
    double x, y, z;
};

static double distance(Point a, Point b)
{
    return std::sqrt((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y) + (a.z - b.z) * (a.z - b.z));
}

// The place on the sheet at rest, of 2 x 1, that has a UV: each half is a chart.
static Point at_rest(double u, double v)
{
    const int chart = u < 0.5 ? 0 : 1;
    return {chart + (u - 0.04 - 0.48 * chart) / 0.44, (v - 0.28) / 0.44, 0};
}

static Point posed(Point p, int pose)
{
    const double s = pose / (poses - 1.0);
    return {p.x + 0.15 * s * p.x * (p.x - 1), p.y - 0.2 * s * p.x * p.y * (1 - p.y), 0.3 * s * p.x * (2 - p.x)};
}

// True within so many units from the centre of the nearest of the four discs of a chart.
static bool in_disc(double u, double v, double within)
{
    const Point p = at_rest(u, v);
    const double x = std::abs(p.x - (u < 0.5 ? 0 : 1) - 0.5) - 0.25, y = std::abs(p.y - 0.5) - 0.25;
    return x * x + y * y < within * within;
}

static std::vector<float> positions(int pose)
{
    std::vector<float> all;
    for (int k = 0; k < 2 * line * line; ++k) {
        const Point p = posed({k / (line * line) + k % line / double(cells), k / line % line / double(cells), 0}, pose);
        all.insert(all.end(), {float(p.x), float(p.y), float(p.z)});
    }
    return all;
}

// The RMS strain of the discs: lengths between neighbouring texels in the pose, over those of what they show.
static double strain(const std::vector<float> &map, int pose)
{
    double sum = 0, step = 1.0 / texels;
    int count = 0;
    for (int k = 0; k < texels * (texels - 1); ++k) {
        const int x = k % texels, y = k / texels;
        for (int dx = 0, dy = 1; dx < 2 && x + 1 < texels; ++dx, --dy) {
            const float *a = &map[2 * k], *b = &map[2 * (k + dy * texels + dx)];
            if (in_disc(a[0], a[1], 0.13) && in_disc(b[0], b[1], 0.13)) {
                const double u = (x + 0.5) * step, v = 1 - (y + 0.5) * step;
                const Point beside = posed(at_rest(u + dx * step, v - dy * step), pose);
                const double now = distance(posed(at_rest(u, v), pose), beside);
                const double e = now / distance(at_rest(a[0], a[1]), at_rest(b[0], b[1])) - 1;
                sum += e * e;
                ++count;
            }
        }
    }
    return std::sqrt(sum / count);
}

int main()
{
    std::vector<std::uint32_t> counts(2 * cells * cells, 4), indices;
    std::vector<float> uvs, own;
    std::vector<std::uint8_t> painted;
    for (int k = 0; k < 2 * line * line; ++k) {
        const int i = k % line, j = k / line % line, chart = k / (line * line);
        uvs.insert(uvs.end(), {float(0.04 + 0.48 * chart + 0.44 * i / cells), float(0.28 + 0.44 * j / cells)});
        for (const int vertex : {k, k + 1, k + line + 1, k + line}) {
            if (i < cells && j < cells) {
                indices.push_back(std::uint32_t(vertex));
            }
        }
    }
    for (int k = 0; k < texels * texels; ++k) {
        const double u = (k % texels + 0.5) / texels, v = 1 - (k / texels + 0.5) / texels;
        own.insert(own.end(), {float(u), float(v)});
        painted.push_back(in_disc(u, v, radius) ? 255 : 0);
    }

    vrtm::DeviceDesc desc;
    desc.set(vrtm::Backend::cpu).set_log([](const auto &entry) { std::fprintf(stderr, "%s\n", entry.message); });
    const vrtm::Device device = vrtm::Device::create(desc).value();
    const std::vector<float> rest = positions(0);
    vrtm::Mesh mesh(vrtm::Array::of<3>(rest), indices);
    mesh.face_counts(counts).uvs(vrtm::Array::of<2>(uvs)).uv_indices(indices);
    const vrtm::Asset asset = vrtm::Asset::create(device, mesh).value();
    const vrtm::Tile tile = asset.find_tile(1001).value();
    tile.set_rigidity(vrtm::Image(painted, texels, texels)).value();
    vrtm::TileSettings settings;
    settings.grid_width = settings.grid_height = 96;
    tile.set_settings(settings).value();

    // A stud: its tip over the middle of the first disc, and two places on its rim.
    const float uv[] = {0.15F, 0.39F, 0.2F, 0.39F, 0.15F, 0.44F}, heights[] = {0.1F, 0, 0};
    const vrtm::Array places = vrtm::Array::of<2>(uv), above = vrtm::Array::of<1>(heights);
    vrtm::CarrierDesc bound;
    bound.at_uvs(places).heights = &above.c();
    const vrtm::Carrier stud = asset.carrier(bound).value();

    // As fast as the mouse moves: each pose takes the place of the one before.
    vrtm::SolveOptions preview;
    preview.set(vrtm::Quality::draft).replace = 1;
    vrtm::Job job;
    for (int pose = 0; pose < poses; ++pose) {
        const std::vector<float> newest = positions(pose);
        job = asset.submit(vrtm::Array::of<3>(newest), preview).value();
    }
    job.wait().value();
    std::printf("preview %.4f\n", tile.report().value().min_jacobian);

    std::vector<float> map(vrtm::image_size(vrtm::FetchKind::redirection, texels, texels)), points(3 * 3);
    const vrtm::ArrayOut out = vrtm::ArrayOut::of<3>(points);
    vrtm::Carried carried;
    carried.positions = &out.c();
    vrtm::Fetches fetches{{tile, vrtm::ImageOut(map, texels, texels)}};
    fetches.add(stud.handle(), carried);
    for (int pose = 0; pose < poses; ++pose) {
        const std::vector<float> exact = positions(pose);
        asset.redirect(vrtm::Array::of<3>(exact), fetches).value();
        if (pose % 8 == 0 || pose == poses - 1) {
            const float *shown = &map[2 * (78 * texels + 19)];
            const Point tip{points[0], points[1], points[2]}, rim{points[3], points[4], points[5]};
            std::printf("%2d  %.4f %.4f  %.4f %.4f  %.4f %.4f %.4f  %.4f\n", pose, strain(own, pose), strain(map, pose),
                        shown[0], shown[1], tip.x, tip.y, tip.z, distance(tip, rim));
        }
    }
}
