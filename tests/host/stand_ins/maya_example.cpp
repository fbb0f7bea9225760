/*
 * Runs the node of examples/hosts/maya with stand-ins of Maya's classes: all tiles, maps that are painted again, frames
 * that read no topology, failed solves, contexts side by side, UVs that stacked charts share.
 */

#include "check.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <thread>
#include <vector>

/* Counts the assets that the node makes. */
static int assets_made;
static vrtm_status counted_asset_create(vrtm_device device, const vrtm_mesh_desc *desc, vrtm_asset *asset)
{
    assets_made += 1;
    return vrtm_asset_create(device, desc, asset);
}
#define vrtm_asset_create counted_asset_create
#include "../../../examples/hosts/maya/vrtm_warp_node.cpp"
#undef vrtm_asset_create

namespace {

namespace fs = std::filesystem;

void check(bool good, const char *name)
{
    check_that(good, name, stand_in_said.empty() ? "" : stand_in_said.back().c_str());
}

sheet s;

/* Two sheets of Maya's, the second in another tile, or on top of the first with the same UVs. */
StandInMesh two_sheets(bool stacked)
{
    StandInMesh mesh;
    for (int part = 0; part < 2; ++part) {
        for (int k = 0; k < VERTICES; ++k) {
            const double *point = s.points[k];
            mesh.points.insert(mesh.points.end(), {point[0] + 20 * part, point[1], point[2], 1});
            if (part == 0 || !stacked) {
                mesh.u.push_back(s.uvs[k][0] + float(part));
                mesh.v.push_back(s.uvs[k][1]);
            }
        }
        for (const std::uint32_t index : s.indices) {
            mesh.vertices.push_back(int(index) + part * VERTICES);
            mesh.uv_ids.push_back(int(index) + (stacked ? 0 : part * VERTICES));
        }
        mesh.counts.insert(mesh.counts.end(), FACES, 4);
    }
    mesh.uv_counts = mesh.counts;
    return mesh;
}

/* A bulge in each sheet, the second farther along. */
StandInMesh posed(const StandInMesh &rest, int frame)
{
    StandInMesh mesh = rest;
    double points[VERTICES][4];
    for (int part = 0; part < 2; ++part) {
        sheet_pose(&s, frame + 2 * part, points);
        for (int k = 0; k < VERTICES; ++k) {
            mesh.points[4 * std::size_t(part * VERTICES + k) + 2] = points[k][2];
        }
    }
    return mesh;
}

MObject object_of(const StandInMesh &mesh)
{
    const MObject object = stand_in_object();
    *object.stand_in = mesh;
    return object;
}

/* A node, and its values in one context. */
struct Scene {
    std::shared_ptr<MPxNode> node{static_cast<MPxNode *>(stand_in_creator())};
    MDataBlock block;

    StandInValue &value(const char *attribute) { return block.stand_in[stand_in_attributes.at(attribute).stand_in]; }
    /* As setAttr and connections do it. */
    void dirty(const char *attribute)
    {
        MPlugArray plugs;
        node->setDependentsDirty(MPlug(stand_in_attributes.at(attribute)), plugs);
    }
    void set(const char *attribute, const MObject &mesh)
    {
        value(attribute).mesh = mesh;
        dirty(attribute);
    }
    void set_maps(const fs::path &path)
    {
        value("rigidity").text = MString(path.string().c_str());
        dirty("rigidity");
    }
    bool compute() { return node->compute(MPlug(stand_in_attributes.at("outMesh")), block); }
    const StandInMesh &out() { return *value("outMesh").mesh.stand_in; }
    int reads() { return value("restMesh").mesh.stand_in->reads; }
};

/* How far the corners of a sheet have moved in UV, at most. */
float moved(const StandInMesh &rest, const StandInMesh &out, int part)
{
    float most = 0;
    for (std::size_t corner = std::size_t(part) * CORNERS; corner < std::size_t(part + 1) * CORNERS; ++corner) {
        const auto at = std::size_t(out.uv_ids[corner]), before = std::size_t(rest.uv_ids[corner]);
        most = std::max({most, std::fabs(out.u[at] - rest.u[before]), std::fabs(out.v[at] - rest.v[before])});
    }
    return most;
}

bool same_uvs(const StandInMesh &a, const StandInMesh &b) { return a.u == b.u && a.v == b.v && a.uv_ids == b.uv_ids; }

/* Writes an image of discs with this radius. `second` is the file's time, since file systems' clocks may be coarse. */
void paint(const fs::path &path, double radius, int second)
{
    std::ofstream file(path, std::ios::binary);
    file << "P5 " << MAP << " " << MAP << " 255\n";
    for (int y = 0; y < MAP; ++y) {
        for (int x = 0; x < MAP; ++x) {
            const double dx = std::fmod(x + 0.5, 16) - 8, dy = std::fmod(y + 0.5, 16) - 8;
            file.put(dx * dx + dy * dy < radius * radius ? char(255) : char(0));
        }
    }
    file.close();
    fs::last_write_time(path, fs::file_time_type() + std::chrono::seconds(second));
}

std::string last_said() { return stand_in_said.empty() ? "" : stand_in_said.back(); }

void tiles_and_maps(const fs::path &folder)
{
    const StandInMesh rest = two_sheets(false);
    Scene scene;
    scene.set("restMesh", object_of(rest));
    scene.set("inMesh", object_of(posed(rest, 3)));
    paint(folder / "rigid.1001.pgm", 5, 1);
    paint(folder / "rigid.1002.pgm", 5, 1);
    scene.set_maps(folder / "rigid.<UDIM>.pgm");
    check(scene.compute(), "two tiles are computed");
    check(moved(rest, scene.out(), 0) > 1e-3f, "the first tile moves");
    check(moved(rest, scene.out(), 1) > 1e-3f, "the second tile moves");
    const StandInMesh first = scene.out();

    paint(folder / "rigid.1002.pgm", 3, 2);
    check(scene.compute() && !same_uvs(first, scene.out()), "a map that is painted again, with the same name, is read");
    Scene fresh;
    fresh.block = scene.block;
    check(fresh.compute() && same_uvs(fresh.out(), scene.out()), "the result is that of a new node");
    paint(folder / "rigid.1002.pgm", 5, 2);
    scene.value("reload").number += 1;
    check(scene.compute() && same_uvs(first, scene.out()), "`reload` has files read whose size and time are the same");
    const MObject reload = stand_in_attributes.at("reload");
    check(MPxNode::stand_in_affecting.count(reload.stand_in) == 1, "it makes the output dirty");

    fs::remove(folder / "rigid.1002.pgm");
    const std::size_t before = stand_in_said.size();
    check(scene.compute() && scene.compute() && stand_in_said.size() == before + 1, "a missing map is warned of once");
    check(last_said().find("rigid.1002.pgm") != std::string::npos, "the warning names the file");
    check(moved(rest, scene.out(), 0) > 1e-3f && moved(rest, scene.out(), 1) == 0, "its tile does not move");
    scene.set_maps(folder / "rigid.1001.pgm");
    check(!scene.compute() && last_said().find("<UDIM>") != std::string::npos, "one file is refused for two tiles");
    scene.set_maps("");
    check(scene.compute() && moved(rest, scene.out(), 0) == 0, "without maps nothing moves");
}

void frames(const fs::path &folder)
{
    const StandInMesh rest = two_sheets(false);
    Scene scene;
    scene.set("restMesh", object_of(rest));
    paint(folder / "all.1001.pgm", 5, 1);
    paint(folder / "all.1002.pgm", 5, 1);
    scene.set_maps(folder / "all.<UDIM>.pgm");
    assets_made = 0;
    bool good = true;
    for (int frame = 1; frame < 4; ++frame) {
        scene.set("inMesh", object_of(posed(rest, frame)));
        good = good && scene.compute();
    }
    check(good && assets_made == 1 && scene.reads() == 1, "frames read the rest mesh once");
    const StandInMesh third = scene.out();

    StandInMesh broken = posed(rest, 3);
    broken.points[4] = std::numeric_limits<double>::quiet_NaN();
    scene.set("inMesh", object_of(broken));
    check(!scene.compute() && last_said().find("error: ") == 0, "a NaN fails, and is told");
    scene.set("inMesh", object_of(posed(rest, 3)));
    check(scene.compute() && same_uvs(third, scene.out()), "the next frame is computed");
    check(assets_made == 1 && scene.reads() == 1, "with the asset of before");

    scene.dirty("restMesh");
    check(scene.compute() && scene.reads() == 2, "a dirty rest mesh is read again");
    check(assets_made == 1, "and keeps its asset if it is the same");
    MEvaluationNode evaluated;
    evaluated.stand_in.insert(stand_in_attributes.at("restMesh").stand_in);
    scene.node->preEvaluation(scene.block.context(), evaluated);
    check(scene.compute() && scene.reads() == 3, "the Evaluation Manager's word of it is heard, too");
    StandInMesh cut = rest;
    for (std::size_t k = 0; k < VERTICES; ++k) {
        cut.u[k] = 0.5f * cut.u[k];
    }
    scene.set("restMesh", object_of(cut));
    check(scene.compute() && assets_made == 2 && !same_uvs(third, scene.out()), "other UVs make another asset");

    /* A cache is filled in the background, with another rest mesh, of which no plug has told. */
    Scene background;
    background.node = scene.node;
    background.block = scene.block;
    background.block.stand_in_context.stand_in_normal = false;
    background.value("restMesh").mesh = object_of(rest);
    check(background.compute() && same_uvs(third, background.out()), "a context of its own is not taken for another");
    check(scene.compute() && !same_uvs(third, scene.out()), "nor the foreground for it");

    background.value("restMesh").mesh = scene.value("restMesh").mesh;
    const StandInMesh alone = scene.out();
    bool two[2] = {};
    std::thread beside([&] { two[0] = background.compute(); });
    two[1] = scene.compute();
    beside.join();
    check(two[0] && two[1], "two evaluations at once");
    check(same_uvs(alone, scene.out()) && same_uvs(alone, background.out()), "give what one gives alone");
    check(scene.node->schedulingType() == MPxNode::kParallel, "which is what the node says of itself");
}

/* The second sheet lies over the first in UV, with the same UVs, and bends in another way. */
void stacked_charts(const fs::path &folder)
{
    const StandInMesh rest = two_sheets(true);
    paint(folder / "stacked.pgm", 5, 1);
    Scene scene;
    scene.set("restMesh", object_of(rest));
    scene.set("inMesh", object_of(posed(rest, 3)));
    scene.set_maps(folder / "stacked.pgm");
    check(scene.compute(), "stacked charts are computed");
    const StandInMesh &out = scene.out();
    check(moved(rest, out, 0) > 1e-3f && moved(rest, out, 1) > 1e-3f, "both charts move");
    check(out.uv_counts == rest.counts && out.u.size() == 2 * rest.u.size(), "each has UVs of its own");

    /* What the library itself writes for each corner. */
    sheet_desc desc;
    sheet_describe(&s, &desc);
    desc.positions.data = rest.points.data();
    desc.positions.count = 2 * VERTICES;
    desc.mesh.face_counts = reinterpret_cast<const std::uint32_t *>(rest.counts.data());
    desc.mesh.indices = reinterpret_cast<const std::uint32_t *>(rest.vertices.data());
    desc.mesh.uv_indices = reinterpret_cast<const std::uint32_t *>(rest.uv_ids.data());
    desc.mesh.face_count = 2 * FACES;
    desc.mesh.index_count = desc.mesh.uv_index_count = 2 * CORNERS;
    desc.mesh.max_layers = 32;
    vrtm_asset asset{};
    vrtm_tile tile{};
    const vrtm_image map = sheet_rigidity(&s);
    const StandInMesh pose = posed(rest, 3);
    std::vector<float> uvs(4 * CORNERS);
    succeeds("an asset of the same", vrtm_asset_create(device.handle(), &desc.mesh, &asset));
    succeeds("its tile", find_udim(asset, 1001, &tile));
    succeeds("its map", vrtm_tile_set_rigidity(tile, &map));
    desc.positions.data = pose.points.data();
    succeeds("its solve", vrtm_asset_solve(asset, &desc.positions, nullptr));
    succeeds("its UVs", vrtm_asset_fetch_corner_uvs(asset, 0, uvs.data(), 2 * CORNERS));
    int other = 0;
    for (std::size_t corner = 0; corner < 2 * CORNERS; ++corner) {
        const auto id = std::size_t(out.uv_ids[corner]);
        other += out.u[id] != uvs[2 * corner] || out.v[id] != uvs[2 * corner + 1];
    }
    check(other == 0, "the node gives each corner the UV that the library does");
    succeeds("the end", vrtm_asset_destroy(asset));
}

} // namespace

int main(int count, char **arguments)
{
    const fs::path folder = count > 1 ? arguments[1] : ".";
    fs::create_directories(folder);
    sheet_make(&s);
    MObject plugin;
    check(initializePlugin(plugin), "the plug-in is loaded");
    tiles_and_maps(folder);
    frames(folder);
    stacked_charts(folder);
    check(uninitializePlugin(plugin), "the plug-in is unloaded");
    return finish();
}
