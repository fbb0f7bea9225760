/*
 * A Maya node that keeps painted features rigid: the rest mesh, the deformed mesh and a rigidity map go in, the deformed
 * mesh with redirected UVs comes out.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Written against the documented classes of the Maya devkit. It has been compiled against stand-ins of these classes only
 * (tests/host/stand_ins/maya), and has never run in Maya: take it as a start, and expect to mend it.
 */

#include "vrtm.hpp"

#include <maya/MDataBlock.h>
#include <maya/MDataHandle.h>
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
#include <maya/MPointArray.h>
#include <maya/MPxNode.h>
#include <maya/MString.h>
#include <maya/MTypeId.h>

#include <memory>
#include <mutex>
#include <string>
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
    std::vector<int> uv_ids; /* of each corner; -1 at faces without UVs */

    explicit Rest(const MFnMesh &mesh) : points(points_of(mesh))
    {
        MIntArray counts_of_faces, vertices, uv_counts, uvs;
        mesh.getVertices(counts_of_faces, vertices);
        counts = values(counts_of_faces);
        connects = values(vertices);
        MFloatArray all_u, all_v;
        mesh.getUVs(all_u, all_v);
        u = values(all_u);
        v = values(all_v);
        /* Maya leaves the corners of faces without UVs out. */
        mesh.getAssignedUVs(uv_counts, uvs);
        unsigned next = 0;
        for (unsigned face = 0; face < counts_of_faces.length(); ++face) {
            const bool mapped = uv_counts[face] == counts_of_faces[face];
            for (int corner = 0; corner < counts_of_faces[face]; ++corner) {
                uv_ids.push_back(mapped ? uvs[next++] : -1);
            }
        }
    }

    bool operator==(const Rest &o) const
    {
        return points == o.points && counts == o.counts && connects == o.connects && u == o.u && v == o.v &&
               uv_ids == o.uv_ids;
    }
};

/* An asset, and what it was made from. */
struct Seat {
    Rest rest;
    vrtm::Asset asset;
    std::string map;
    int grid = -1;
};

class VrtmWarpNode : public MPxNode {
public:
    static void *creator() { return new VrtmWarpNode; }
    static MStatus initialize();

    /* Maya may evaluate nodes side by side, and one node for several contexts. */
    SchedulingType schedulingType() const override { return kParallel; }
    MStatus compute(const MPlug &plug, MDataBlock &block) override;

    static const MTypeId id;
    static MObject rest_mesh, in_mesh, rigidity, grid, quality, out_mesh;

private:
    std::unique_ptr<Seat> take_seat(const MFnMesh &rest_mesh);
    static void set_map(Seat &seat, const MString &file, int grid);

    std::mutex mutex_;
    std::vector<std::unique_ptr<Seat>> free_;
};

/* From the range for internal use: ask Autodesk for one of your own. */
const MTypeId VrtmWarpNode::id(0x0007f7a0);
MObject VrtmWarpNode::rest_mesh, VrtmWarpNode::in_mesh, VrtmWarpNode::rigidity, VrtmWarpNode::grid,
    VrtmWarpNode::quality, VrtmWarpNode::out_mesh;

MStatus VrtmWarpNode::initialize()
{
    MFnTypedAttribute typed;
    MFnNumericAttribute numeric;
    MFnEnumAttribute list;
    rest_mesh = typed.create("restMesh", "rm", MFnData::kMesh);
    in_mesh = typed.create("inMesh", "im", MFnData::kMesh);
    rigidity = typed.create("rigidity", "rg", MFnData::kString);
    typed.setUsedAsFilename(true);
    grid = numeric.create("grid", "gr", MFnNumericData::kInt, 0);
    numeric.setMin(0);
    numeric.setMax(16384);
    quality = list.create("quality", "qu", VRTM_QUALITY_NORMAL);
    list.addField("normal", VRTM_QUALITY_NORMAL);
    list.addField("draft", VRTM_QUALITY_DRAFT);
    list.addField("high", VRTM_QUALITY_HIGH);
    out_mesh = typed.create("outMesh", "om", MFnData::kMesh);
    typed.setWritable(false);
    typed.setStorable(false);
    for (const MObject &attribute : {rest_mesh, in_mesh, rigidity, grid, quality, out_mesh}) {
        addAttribute(attribute);
    }
    for (const MObject &attribute : {rest_mesh, in_mesh, rigidity, grid, quality}) {
        attributeAffects(attribute, out_mesh);
    }
    return MS::kSuccess;
}

/* An asset of this mesh that no other evaluation is using; a new one if there is none. */
std::unique_ptr<Seat> VrtmWarpNode::take_seat(const MFnMesh &mesh)
{
    Rest rest(mesh);
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        while (!free_.empty()) {
            std::unique_ptr<Seat> seat = std::move(free_.back());
            free_.pop_back();
            if (seat->rest == rest) {
                return seat;
            }
            /* Of a mesh that the node had before. */
        }
    }
    vrtm::Mesh description(vrtm::Array(rest.points.data(), rest.points.size() / 4, 4 * sizeof(double)), rest.connects);
    description.face_counts(rest.counts)
        .uvs(vrtm::Array(rest.u.data(), rest.u.size()), vrtm::Array(rest.v.data(), rest.v.size()))
        .uv_indices(rest.uv_ids);
    vrtm::Asset asset = vrtm::Asset::create(device, description).value();
    return std::unique_ptr<Seat>(new Seat{std::move(rest), std::move(asset), {}, -1});
}

/* The map of the first tile; one map per tile would be a list of files. */
void VrtmWarpNode::set_map(Seat &seat, const MString &file, int cells)
{
    const vrtm::Tile tile = seat.asset.tile(0).value();
    if (seat.map != file.asChar()) {
        MImage image;
        unsigned width = 0, height = 0;
        if (file.length() == 0) {
            tile.set_rigidity(nullptr).value();
        } else if (image.readFromFile(file) && image.getSize(width, height)) {
            /* RGBA, from the bottom: the red channel is taken. */
            tile.set_rigidity(
                vrtm::Image(image.pixels(), width, height).pixel_stride(4).origin(vrtm::Origin::bottom)).value();
        } else {
            MGlobal::displayWarning(MString("vrtm: cannot read ") + file);
        }
        seat.map = file.asChar();
    }
    if (seat.grid != cells) {
        vrtm::TileSettings settings;
        settings.grid_width = settings.grid_height = std::uint32_t(cells);
        tile.set_settings(settings).value();
        seat.grid = cells;
    }
}

MStatus VrtmWarpNode::compute(const MPlug &plug, MDataBlock &block)
{
    if (plug != out_mesh) {
        return MS::kUnknownParameter;
    }
    const MObject rest_data = block.inputValue(rest_mesh).asMesh();
    const MObject in_data = block.inputValue(in_mesh).asMesh();
    if (rest_data.isNull() || in_data.isNull()) {
        return MS::kFailure;
    }
    try {
        const MFnMesh in(in_data);
        std::unique_ptr<Seat> seat = take_seat(MFnMesh(rest_data));
        set_map(*seat, block.inputValue(rigidity).asString(), block.inputValue(grid).asInt());

        vrtm::SolveOptions options;
        options.set(vrtm::Quality(block.inputValue(quality).asShort()));
        const std::vector<double> points = points_of(in);
        seat->asset.solve(vrtm::Array(points.data(), points.size() / 4, 4 * sizeof(double)), options).value();

        /* Corners that share a UV move alike, so each UV gets the value of any of its corners. */
        const std::vector<int> &uv_ids = seat->rest.uv_ids;
        std::vector<float> corners(2 * uv_ids.size()), u = seat->rest.u, v = seat->rest.v;
        seat->asset.corner_uvs(corners.data(), uv_ids.size()).value();
        for (std::size_t corner = 0; corner < uv_ids.size(); ++corner) {
            if (uv_ids[corner] >= 0) {
                u[std::size_t(uv_ids[corner])] = corners[2 * corner];
                v[std::size_t(uv_ids[corner])] = corners[2 * corner + 1];
            }
        }

        MFnMeshData data;
        const MObject out_data = data.create();
        MFnMesh out;
        out.copy(in_data, out_data);
        out.setUVs(MFloatArray(u.data(), unsigned(u.size())), MFloatArray(v.data(), unsigned(v.size())));
        MDataHandle handle = block.outputValue(out_mesh);
        handle.setMObject(out_data);
        handle.setClean();
        const std::lock_guard<std::mutex> lock(mutex_);
        free_.push_back(std::move(seat));
        return MS::kSuccess;
    } catch (const vrtm::Error &error) {
        MGlobal::displayError(MString("vrtm: ") + error.what());
        return MS::kFailure;
    }
}

} // namespace

MStatus initializePlugin(MObject object)
{
    vrtm::DeviceDesc desc;
    desc.set_log([](vrtm::LogLevel level, const char *message) {
        if (level == vrtm::LogLevel::warning) {
            MGlobal::displayWarning(MString("vrtm: ") + message);
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
