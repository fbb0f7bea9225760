/*
 * A Maya node that keeps painted features rigid: the rest mesh, the deformed mesh and rigidity maps go in, the deformed
 * mesh with redirected UVs comes out.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Why an MPxNode and not an MPxDeformerNode: deform() of a deformer is handed the points of one mesh, and moves points.
 * This node moves none. It reads two whole meshes and sets UVs: of a deformer it could use neither the iterator nor
 * envelope, weights and membership, and would still have to override compute(), and to declare kDeformsUVs.
 *
 * Written against the documented classes of the Maya devkit. The tests compile and run it with stand-ins of these
 * (tests/host/stand_ins/maya_example.cpp). It has never run in Maya: take it as a start, and expect to mend it.
 */

#include "vrtm.hpp"

#include <maya/MDGContext.h>
#include <maya/MDataBlock.h>
#include <maya/MDataHandle.h>
#include <maya/MEvaluationNode.h>
#include <maya/MFloatArray.h>
#include <maya/MFnEnumAttribute.h>
#include <maya/MFnMesh.h>
#include <maya/MFnMeshData.h>
#include <maya/MFnNumericAttribute.h>
#include <maya/MFnPlugin.h>
#include <maya/MFnTypedAttribute.h>
#include <maya/MGlobal.h>
#include <maya/MImage.h>
#include <maya/MIntArray.h>
#include <maya/MPlug.h>
#include <maya/MPlugArray.h>
#include <maya/MPointArray.h>
#include <maya/MPxNode.h>
#include <maya/MString.h>
#include <maya/MTypeId.h>

#include <atomic>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace {

/* One for all nodes, from initializePlugin to uninitializePlugin. */
vrtm::Device device;

std::vector<int> values(const MIntArray &array)
{
    std::vector<int> values(array.length());
    array.get(values.data());
    return values;
}

std::vector<float> values(const MFloatArray &array)
{
    std::vector<float> values(array.length());
    array.get(values.data());
    return values;
}

/* Four doubles per vertex. */
std::vector<double> points_of(const MFnMesh &mesh)
{
    MPointArray points;
    mesh.getPoints(points, MSpace::kObject);
    std::vector<double> values(4 * std::size_t(points.length()));
    points.get(reinterpret_cast<double(*)[4]>(values.data()));
    return values;
}

/* A mesh at rest, as the library takes it. */
struct Rest {
    std::vector<double> points;
    std::vector<int> counts, connects;
    std::vector<float> u, v;
    std::vector<int> uv_counts; /* of each face: 0, or as many as it has corners */
    std::vector<int> uv_ids;    /* of each corner; -1 at faces without UVs */

    explicit Rest(const MFnMesh &mesh) : points(points_of(mesh))
    {
        MIntArray counts_of_faces, vertices, uv_counts_of_faces, uvs;
        mesh.getVertices(counts_of_faces, vertices);
        counts = values(counts_of_faces);
        connects = values(vertices);
        MFloatArray all_u, all_v;
        mesh.getUVs(all_u, all_v);
        u = values(all_u);
        v = values(all_v);
        /* Maya leaves the corners of faces without UVs out. */
        mesh.getAssignedUVs(uv_counts_of_faces, uvs);
        uv_counts = values(uv_counts_of_faces);
        unsigned next = 0;
        for (std::size_t face = 0; face < counts.size(); ++face) {
            for (int corner = 0; corner < counts[face]; ++corner) {
                uv_ids.push_back(uv_counts[face] == counts[face] ? uvs[next++] : -1);
            }
        }
    }

    bool operator==(const Rest &o) const
    {
        return points == o.points && counts == o.counts && connects == o.connects && u == o.u && v == o.v &&
               uv_counts == o.uv_counts && uv_ids == o.uv_ids;
    }
};

/* A file of a rigidity map, as it was when it was read. */
struct MapFile {
    std::string path;
    int reload;
    std::filesystem::file_time_type time;
    std::uintmax_t size;

    MapFile(std::string file, int reload_of_node) : path(std::move(file)), reload(reload_of_node)
    {
        std::error_code missing; /* Then both are the same values each time. */
        time = std::filesystem::last_write_time(path, missing);
        size = std::filesystem::file_size(path, missing);
    }
    bool operator==(const MapFile &o) const
    {
        return path == o.path && reload == o.reload && time == o.time && size == o.size;
    }
};

/* An asset, and what it was given. */
struct Seat {
    Rest rest;
    unsigned edition = 0; /* of the rest mesh */
    vrtm::Asset asset;
    std::vector<vrtm::Tile> tiles;
    std::vector<std::optional<MapFile>> files; /* of each tile */
    std::vector<int> uv_ids;                   /* of each corner of the result */
    std::size_t uvs;                           /* of the result */

    explicit Seat(Rest mesh);
    void set_maps(const std::string &pattern, int reload, int grid);
    void write(MFnMesh &mesh) const;
};

class VrtmWarpNode : public MPxNode {
public:
    static void *creator() { return new VrtmWarpNode; }
    static MStatus initialize();

    /* The Evaluation Manager may compute nodes side by side, and one node for several contexts. */
    SchedulingType schedulingType() const override { return kParallel; }
    MStatus compute(const MPlug &plug, MDataBlock &block) override;

    /* Both say that the rest mesh may have changed: the first where Maya propagates dirtiness, the second where the
     * Evaluation Manager does without. The next compute compares it with the asset's own; all others need not. */
    MStatus setDependentsDirty(const MPlug &plug, MPlugArray &) override
    {
        rest_edition_ += plug == rest_mesh;
        return MS::kSuccess;
    }
    MStatus preEvaluation(const MDGContext &context, const MEvaluationNode &node) override
    {
        rest_edition_ += context.isNormal() && node.dirtyPlugExists(rest_mesh);
        return MS::kSuccess;
    }

    static const MTypeId id;
    static MObject rest_mesh, in_mesh, rigidity, reload, grid, quality, out_mesh;

private:
    std::unique_ptr<Seat> take_seat(const MFnMesh &mesh, unsigned edition);

    /* Of other contexts, such as the frames that a cache is filled with, no edition is known. */
    static constexpr unsigned unknown = 0;
    std::atomic<unsigned> rest_edition_{1};
    std::mutex mutex_;
    std::vector<std::unique_ptr<Seat>> free_;
};

/* From the range for internal use: ask Autodesk for one of your own. */
const MTypeId VrtmWarpNode::id(0x0007f7a0);
MObject VrtmWarpNode::rest_mesh, VrtmWarpNode::in_mesh, VrtmWarpNode::rigidity, VrtmWarpNode::reload,
    VrtmWarpNode::grid, VrtmWarpNode::quality, VrtmWarpNode::out_mesh;

MStatus VrtmWarpNode::initialize()
{
    MFnTypedAttribute typed;
    MFnNumericAttribute numeric;
    MFnEnumAttribute list;
    rest_mesh = typed.create("restMesh", "rm", MFnData::kMesh);
    in_mesh = typed.create("inMesh", "im", MFnData::kMesh);
    rigidity = typed.create("rigidity", "rg", MFnData::kString);
    typed.setUsedAsFilename(true);
    reload = numeric.create("reload", "rl", MFnNumericData::kInt, 0);
    grid = numeric.create("grid", "gr", MFnNumericData::kInt, 0);
    numeric.setMin(0);
    numeric.setMax(16384);
    quality = list.create("quality", "qu", VRTM_QUALITY_NORMAL);
    list.addField("normal", VRTM_QUALITY_NORMAL);
    list.addField("draft", VRTM_QUALITY_DRAFT);
    out_mesh = typed.create("outMesh", "om", MFnData::kMesh);
    typed.setWritable(false);
    typed.setStorable(false);
    for (const MObject &attribute : {rest_mesh, in_mesh, rigidity, reload, grid, quality, out_mesh}) {
        addAttribute(attribute);
    }
    for (const MObject &attribute : {rest_mesh, in_mesh, rigidity, reload, grid, quality}) {
        attributeAffects(attribute, out_mesh);
    }
    return MS::kSuccess;
}

Seat::Seat(Rest mesh) : rest(std::move(mesh)), uvs(rest.u.size())
{
    vrtm::Mesh description(vrtm::Array::of<4>(rest.points), rest.connects);
    description.face_counts(rest.counts)
        .uvs(vrtm::Array::of<1>(rest.u), vrtm::Array::of<1>(rest.v))
        .uv_indices(rest.uv_ids)
        .max_layers(32);
    asset = vrtm::Asset::create(device, description).value();
    tiles = asset.tiles().value();
    files.resize(tiles.size());

    /* Charts that lie over one another move apart, and may have shared UVs: each layer but the first gets its own. */
    const std::vector<std::uint32_t> layers = asset.face_layers().value();
    std::map<std::pair<int, std::uint32_t>, int> of_layers;
    std::size_t corner = 0;
    for (std::size_t face = 0; face < rest.counts.size(); ++face) {
        for (int k = 0; k < rest.counts[face]; ++k, ++corner) {
            int id = rest.uv_ids[corner];
            if (id >= 0 && layers[face] > 0) {
                const auto made = of_layers.emplace(std::make_pair(id, layers[face]), int(uvs));
                id = made.first->second;
                uvs += made.second;
            }
            uv_ids.push_back(id);
        }
    }
}

/* Reads maps that have been painted since. The pattern is a path, for several tiles with <UDIM>. */
void Seat::set_maps(const std::string &pattern, int reload, int grid)
{
    const std::size_t at = pattern.find("<UDIM>");
    for (std::size_t i = 0; i < tiles.size(); ++i) {
        vrtm::TileSettings settings;
        settings.grid_width = settings.grid_height = std::uint32_t(grid);
        /* Of no effect if they are the same as before. */
        tiles[i].set_settings(settings).value();
        if (tiles[i].key().value().layer > 0) {
            continue; /* It has the map of layer 0. */
        }
        std::string path = pattern;
        const std::uint32_t udim = tiles[i].udim().value();
        if (at != std::string::npos) {
            path.replace(at, 6, std::to_string(udim));
        } else if (!path.empty() && udim != tiles[0].udim().value()) {
            throw std::runtime_error("the mesh has several tiles: write <UDIM> for their numbers in " + path);
        }
        const MapFile file(path, reload);
        if (files[i] == file) {
            continue;
        }
        MImage image;
        unsigned width = 0, height = 0;
        if (!path.empty() && image.readFromFile(path.c_str()) && image.getSize(width, height)) {
            /* RGBA, from the bottom: the red channel is taken. */
            tiles[i].set_rigidity(
                vrtm::Image(image.pixels(), width, height).pixel_stride(4).origin(vrtm::Origin::bottom)).value();
        } else {
            tiles[i].set_rigidity(nullptr).value();
            if (!path.empty()) {
                MGlobal::displayWarning(MString("vrtm: cannot read ") + path.c_str() + ": this tile does not move");
            }
        }
        files[i] = file;
    }
}

/* Corners that share a UV move alike, so each UV gets the value of any of its corners. */
void Seat::write(MFnMesh &mesh) const
{
    std::vector<float> corners(2 * uv_ids.size()), u = rest.u, v = rest.v;
    asset.corner_uvs(corners).value();
    u.resize(uvs);
    v.resize(uvs);
    std::vector<int> assigned;
    for (std::size_t corner = 0; corner < uv_ids.size(); ++corner) {
        if (uv_ids[corner] >= 0) {
            u[std::size_t(uv_ids[corner])] = corners[2 * corner];
            v[std::size_t(uv_ids[corner])] = corners[2 * corner + 1];
            assigned.push_back(uv_ids[corner]);
        }
    }
    mesh.setUVs(MFloatArray(u.data(), unsigned(u.size())), MFloatArray(v.data(), unsigned(v.size())));
    if (uvs > rest.u.size()) {
        mesh.assignUVs(MIntArray(rest.uv_counts.data(), unsigned(rest.uv_counts.size())),
                       MIntArray(assigned.data(), unsigned(assigned.size())));
    }
}

/* An asset of this mesh that no other evaluation is using; a new one if there is none. */
std::unique_ptr<Seat> VrtmWarpNode::take_seat(const MFnMesh &mesh, unsigned edition)
{
    std::unique_ptr<Seat> seat;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (!free_.empty()) {
            seat = std::move(free_.back());
            free_.pop_back();
        }
    }
    if (seat != nullptr && edition != unknown && seat->edition == edition) {
        return seat;
    }
    Rest rest(mesh);
    if (seat == nullptr || !(seat->rest == rest)) {
        seat.reset(); /* First, for the memory. */
        seat.reset(new Seat(std::move(rest)));
    }
    seat->edition = edition;
    return seat;
}

MStatus VrtmWarpNode::compute(const MPlug &plug, MDataBlock &block)
{
    if (plug != out_mesh) {
        return MS::kUnknownParameter;
    }
    const unsigned edition = block.context().isNormal() ? rest_edition_.load() : unknown;
    const MObject rest_data = block.inputValue(rest_mesh).asMesh();
    const MObject in_data = block.inputValue(in_mesh).asMesh();
    if (rest_data.isNull() || in_data.isNull()) {
        return MS::kFailure;
    }
    std::unique_ptr<Seat> seat;
    MStatus status = MS::kSuccess;
    try {
        seat = take_seat(MFnMesh(rest_data), edition);
        seat->set_maps(block.inputValue(rigidity).asString().asChar(), block.inputValue(reload).asInt(),
                       block.inputValue(grid).asInt());
        vrtm::SolveOptions options;
        options.set(vrtm::Quality(block.inputValue(quality).asShort()));
        const std::vector<double> points = points_of(MFnMesh(in_data));
        seat->asset.solve(vrtm::Array::of<4>(points), options).value();

        MFnMeshData data;
        const MObject out_data = data.create();
        MFnMesh out;
        out.copy(in_data, out_data);
        seat->write(out);
        MDataHandle handle = block.outputValue(out_mesh);
        handle.setMObject(out_data);
        handle.setClean();
    } catch (const std::exception &error) {
        MGlobal::displayError(MString("vrtm: ") + error.what());
        status = MS::kFailure;
    }
    if (seat != nullptr) {
        /* A failed solve leaves the asset as it was: the next frame may be a good one. */
        const std::lock_guard<std::mutex> lock(mutex_);
        free_.push_back(std::move(seat));
    }
    return status;
}

} // namespace

MStatus initializePlugin(MObject object)
{
    vrtm::DeviceDesc desc;
    desc.set_log([](const vrtm_log_entry &entry) {
        if (entry.level == VRTM_LOG_LEVEL_WARNING) {
            MGlobal::displayWarning(MString("vrtm: ") + entry.message);
        }
    });
    vrtm::Result<vrtm::Device> made = vrtm::Device::create(desc);
    if (!made) {
        MGlobal::displayError(MString("vrtm: ") + made.message());
        return MS::kFailure;
    }
    device = std::move(*made);
    MFnPlugin plugin(object, "vrtm", "0.1");
    return plugin.registerNode("vrtmWarp", VrtmWarpNode::id, VrtmWarpNode::creator, VrtmWarpNode::initialize);
}

/* Maya calls it when no node is left. */
MStatus uninitializePlugin(MObject object)
{
    const MStatus status = MFnPlugin(object).deregisterNode(VrtmWarpNode::id);
    device.reset();
    return status;
}
