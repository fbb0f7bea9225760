/*
 * A Houdini SOP that keeps painted features rigid: the deformed geometry is its first input, the same geometry at rest
 * its second, with the vertex attribute `uv` and the point attribute `rigidity` (0..1). Its output is the first input with
 * redirected UVs.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Written against the documented classes of the Houdini Development Kit. The tests compile and run it with stand-ins of
 * these (tests/host/stand_ins/houdini_example.cpp). It has never run in Houdini: take it as a start, and expect to mend
 * it.
 */

#include "vrtm.hpp"

#include <GA/GA_Handle.h>
#include <GA/GA_Iterator.h>
#include <GA/GA_Primitive.h>
#include <GEO/GEO_PrimPoly.h>
#include <GU/GU_Detail.h>
#include <OP/OP_AutoLockInputs.h>
#include <OP/OP_Context.h>
#include <OP/OP_Operator.h>
#include <OP/OP_OperatorTable.h>
#include <PRM/PRM_Include.h>
#include <SOP/SOP_Node.h>
#include <UT/UT_DSOVersion.h>
#include <UT/UT_Interrupt.h>
#include <UT/UT_ParallelUtil.h>

#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

/* Houdini's threads. Loops are told in blocks of indices. */
struct HoudiniThreads {
    void parallel_for(std::size_t count, vrtm::Task task)
    {
        UTparallelForEachNumber(exint(count), [task](const UT_BlockedRange<exint> &range) {
            for (exint index = range.begin(); index != range.end(); ++index) {
                task(std::size_t(index));
            }
        });
    }
};

std::vector<UT_Vector3> positions_of(const GU_Detail *geometry)
{
    std::vector<UT_Vector3> positions;
    GA_Offset point;
    GA_FOR_ALL_PTOFF(geometry, point)
    {
        positions.push_back(geometry->getPos3(point));
    }
    return positions;
}

const GA_Attribute *uv_of(const GU_Detail *geometry)
{
    return geometry->findFloatTuple(GA_ATTRIB_VERTEX, "uv", 2, 3);
}

GA_DataId id_of(const GA_Attribute *attribute)
{
    return attribute == nullptr ? GA_INVALID_DATAID : attribute->getDataId();
}

/* What Houdini numbers the data of a geometry with: it has not changed where all numbers are valid and the same. */
struct DataIds {
    GA_DataId topology = GA_INVALID_DATAID, primitives = GA_INVALID_DATAID, positions = GA_INVALID_DATAID,
              uvs = GA_INVALID_DATAID;

    DataIds() = default;
    explicit DataIds(const GU_Detail *geometry)
        : topology(geometry->getTopology().getDataId()), primitives(geometry->getPrimitiveList().getDataId()),
          positions(id_of(geometry->getP())), uvs(id_of(uv_of(geometry)))
    {
    }
    bool same(const DataIds &o) const
    {
        const bool valid = topology != GA_INVALID_DATAID && primitives != GA_INVALID_DATAID &&
                           positions != GA_INVALID_DATAID && uvs != GA_INVALID_DATAID;
        return valid && topology == o.topology && primitives == o.primitives && positions == o.positions &&
               uvs == o.uvs;
    }
};

/* The corners of all polygons. Curves, volumes and the like have no surface. */
struct Corners {
    std::vector<int> counts;
    std::vector<GA_Offset> vertices;

    explicit Corners(const GU_Detail *geometry)
    {
        const GA_Primitive *primitive;
        GA_FOR_ALL_PRIMITIVES(geometry, primitive)
        {
            const GA_Size count = primitive->getTypeId() == GEO_PRIMPOLY ? primitive->getVertexCount() : 0;
            counts.push_back(int(count));
            for (GA_Size corner = 0; corner < count; ++corner) {
                vertices.push_back(primitive->getVertexOffset(corner));
            }
        }
    }
};

/* Polygons and their UVs, as the library takes them. */
struct Rest {
    std::vector<UT_Vector3> positions, uvs;
    std::vector<int> counts, points;

    Rest() = default;
    explicit Rest(const GU_Detail *geometry) : positions(positions_of(geometry))
    {
        const GA_ROHandleV3 uv(uv_of(geometry));
        if (!uv.isValid()) {
            throw std::runtime_error("the second input has no vertex attribute uv");
        }
        const Corners corners(geometry);
        counts = corners.counts;
        for (const GA_Offset vertex : corners.vertices) {
            points.push_back(int(geometry->pointIndex(geometry->vertexPoint(vertex))));
            uvs.push_back(uv.get(vertex));
        }
    }

    bool operator==(const Rest &o) const
    {
        return positions == o.positions && uvs == o.uvs && counts == o.counts && points == o.points;
    }
};

class SOP_VrtmWarp : public SOP_Node {
public:
    static OP_Node *create(OP_Network *network, const char *name, OP_Operator *type)
    {
        return new SOP_VrtmWarp(network, name, type);
    }
    static PRM_Template *templates();

    const char *inputLabel(unsigned index) const override { return index == 0 ? "Deformed" : "Rest"; }

protected:
    SOP_VrtmWarp(OP_Network *network, const char *name, OP_Operator *type) : SOP_Node(network, name, type) {}
    OP_ERROR cookMySop(OP_Context &context) override;

private:
    void make_device();
    void forget_warnings(vrtm_log_code first);
    void update(const GU_Detail *rest_geometry);
    void update_rigidity(const GU_Detail *rest_geometry);
    void warp(int cells, vrtm::Quality quality, UT_AutoInterrupt &interrupt);

    /* Warnings of the log by code and tile, and their lock: any thread may tell one. Each cook shows them again. */
    std::map<std::pair<vrtm_log_code, std::uint32_t>, std::string> warnings_;
    std::mutex mutex_;
    /* What the node keeps from cook to cook. A node is not cooked twice at the same time. */
    vrtm::Device device_;
    vrtm::Asset asset_;
    Rest rest_;
    DataIds ids_;
    std::vector<float> rigidity_;
    GA_DataId rigidity_id_ = GA_INVALID_DATAID;
};

PRM_Template *SOP_VrtmWarp::templates()
{
    static PRM_Name names[] = {PRM_Name("grid", "Grid"), PRM_Name("quality", "Quality")};
    static PRM_Name qualities[] = {PRM_Name("normal", "Normal"), PRM_Name("draft", "Draft"), PRM_Name()};
    static PRM_ChoiceList menu(PRM_CHOICELIST_SINGLE, qualities);
    static PRM_Default cells(1024);
    static PRM_Template list[] = {PRM_Template(PRM_INT, 1, &names[0], &cells),
                                  PRM_Template(PRM_ORD, 1, &names[1], nullptr, &menu), PRM_Template()};
    return list;
}

OP_ERROR SOP_VrtmWarp::cookMySop(OP_Context &context)
{
    OP_AutoLockInputs inputs(this);
    if (inputs.lock(context) >= UT_ERROR_ABORT) {
        return error();
    }
    duplicateSource(0, context);
    const GU_Detail *rest_geometry = inputGeo(1, context);
    const fpreal time = context.getTime();
    UT_AutoInterrupt interrupt("Keeping features rigid");
    try {
        make_device();
        forget_warnings(VRTM_LOG_CODE_POSE_SCALE);
        update(rest_geometry);
        update_rigidity(rest_geometry);
        warp(int(evalInt("grid", 0, time)), vrtm::Quality(evalInt("quality", 0, time)), interrupt);
    } catch (const vrtm::Error &failed) {
        /* Of an interrupted cook Houdini tells itself. */
        if (failed.code() != vrtm::Code::cancelled) {
            addError(SOP_MESSAGE, failed.what());
        }
    } catch (const std::exception &failed) {
        addError(SOP_MESSAGE, failed.what());
    }
    for (const auto &warning : warnings_) {
        addWarning(SOP_MESSAGE, warning.second.c_str());
    }
    return error();
}

/* Each node has its own, since a log belongs to a device. */
void SOP_VrtmWarp::make_device()
{
    if (device_) {
        return;
    }
    vrtm::DeviceDesc desc;
    desc.set(vrtm::Backend::cpu).set_executor(std::shared_ptr<HoudiniThreads>(new HoudiniThreads));
    desc.set_log([this](const vrtm_log_entry &entry) {
        if (entry.level == VRTM_LOG_LEVEL_WARNING) {
            const std::lock_guard<std::mutex> lock(mutex_);
            warnings_[{entry.code, entry.udim}] = entry.message;
        }
    });
    device_ = vrtm::Device::create(desc).value();
}

/* Codes are numbered in the order mesh, maps, grid, pose: a new map leaves the warnings of the mesh. */
void SOP_VrtmWarp::forget_warnings(vrtm_log_code first)
{
    warnings_.erase(warnings_.lower_bound({first, 0}), warnings_.end());
}

/* Makes another asset if the rest geometry is another one, which is looked at only if its numbers are. */
void SOP_VrtmWarp::update(const GU_Detail *rest_geometry)
{
    const DataIds ids(rest_geometry);
    if (asset_ && ids.same(ids_)) {
        return;
    }
    Rest rest(rest_geometry);
    if (!asset_ || !(rest == rest_)) {
        asset_.reset();
        forget_warnings(0);
        rigidity_.clear();
        rigidity_id_ = GA_INVALID_DATAID;
        vrtm::Mesh mesh(vrtm::Array::of<float>(rest.positions), rest.points);
        mesh.face_counts(rest.counts).uvs(vrtm::Array::of<float>(rest.uvs)).max_layers(32);
        asset_ = vrtm::Asset::create(device_, mesh).value();
        rest_ = std::move(rest);
    }
    ids_ = ids;
}

/* Paint changes no asset. */
void SOP_VrtmWarp::update_rigidity(const GU_Detail *rest_geometry)
{
    const GA_Attribute *attribute = rest_geometry->findFloatTuple(GA_ATTRIB_POINT, "rigidity", 1, 1);
    if (attribute == nullptr) {
        addWarning(SOP_MESSAGE, "the second input has no point attribute rigidity: nothing moves");
    }
    const GA_DataId id = id_of(attribute);
    if (id != GA_INVALID_DATAID && id == rigidity_id_) {
        return;
    }
    const GA_ROHandleF rigid(attribute);
    std::vector<float> rigidity;
    GA_Offset point;
    GA_FOR_ALL_PTOFF(rest_geometry, point)
    {
        rigidity.push_back(rigid.isValid() ? rigid.get(point) : 0.0f);
    }
    if (rigidity != rigidity_) {
        forget_warnings(VRTM_LOG_CODE_RIGIDITY_RANGE);
        asset_.set_vertex_rigidity(vrtm::Array::of<1>(rigidity)).value();
        rigidity_ = std::move(rigidity);
    }
    rigidity_id_ = id;
}

void SOP_VrtmWarp::warp(int cells, vrtm::Quality quality, UT_AutoInterrupt &interrupt)
{
    for (const vrtm::Tile tile : asset_.tiles().value()) {
        vrtm::TileSettings settings;
        settings.grid_width = settings.grid_height = std::uint32_t(cells);
        /* Of no effect if they are the same as before. */
        tile.set_settings(settings).value();
    }
    const Corners corners(gdp);
    if (corners.counts != rest_.counts) {
        throw std::runtime_error("the two inputs have different polygons");
    }
    vrtm::SolveOptions options;
    options.set(quality).set_progress(
        [&interrupt](float) { return interrupt.wasInterrupted() ? vrtm::Proceed::no : vrtm::Proceed::yes; });
    const std::vector<UT_Vector3> positions = positions_of(gdp);
    asset_.solve(vrtm::Array::of<float>(positions), options).value();

    const std::size_t count = corners.vertices.size();
    std::vector<float> uvs(2 * count);
    asset_.corner_uvs(uvs).value();
    const GA_RWHandleV3 uv(gdp->addFloatTuple(GA_ATTRIB_VERTEX, "uv", 3));
    for (std::size_t corner = 0; corner < count; ++corner) {
        uv.set(corners.vertices[corner], UT_Vector3(uvs[2 * corner], uvs[2 * corner + 1], 0));
    }
}

} // namespace

void newSopOperator(OP_OperatorTable *table)
{
    PRM_Template *templates = SOP_VrtmWarp::templates();
    table->addOperator(new OP_Operator("vrtm_warp", "VRTM Warp", SOP_VrtmWarp::create, templates, 2, 2));
}
