/*
 * A Houdini SOP that keeps painted features rigid: the deformed geometry is its first input, the same geometry at rest its
 * second, with the vertex attribute `uv` and the point attribute `rigidity` (0..1). Its output is the first input with
 * redirected UVs.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Written against the documented classes of the Houdini Development Kit. It has been compiled against stand-ins of these
 * classes only (tests/host/stand_ins/houdini), and has never run in Houdini: take it as a start, and expect to mend it.
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

#include <memory>
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

/* One for all nodes: made by the first cook, and ended when Houdini unloads the library. */
const vrtm::Device &device()
{
    static const vrtm::Device device = [] {
        vrtm::DeviceDesc desc;
        desc.set(vrtm::Backend::cpu).set_executor(std::shared_ptr<HoudiniThreads>(new HoudiniThreads));
        return vrtm::Device::create(desc).value();
    }();
    return device;
}

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

/* Polygons and their UVs and rigidity, as the library takes them. */
struct Rest {
    std::vector<UT_Vector3> positions, uvs;
    std::vector<float> rigidity;
    std::vector<int> counts, points;
    std::vector<GA_Offset> vertices; /* of each corner */

    explicit Rest(const GU_Detail *geometry) : positions(positions_of(geometry))
    {
        const GA_ROHandleV3 uv(geometry->findFloatTuple(GA_ATTRIB_VERTEX, "uv", 2, 3));
        const GA_ROHandleF rigid(geometry->findFloatTuple(GA_ATTRIB_POINT, "rigidity", 1, 1));
        GA_Offset point;
        GA_FOR_ALL_PTOFF(geometry, point)
        {
            rigidity.push_back(rigid.isValid() ? rigid.get(point) : 0.0f);
        }
        const GA_Primitive *primitive;
        GA_FOR_ALL_PRIMITIVES(geometry, primitive)
        {
            /* Curves, volumes and the like have no surface. */
            const GA_Size corners = primitive->getTypeId() == GEO_PRIMPOLY ? primitive->getVertexCount() : 0;
            counts.push_back(int(corners));
            for (GA_Size corner = 0; corner < corners; ++corner) {
                const GA_Offset vertex = primitive->getVertexOffset(corner);
                vertices.push_back(vertex);
                points.push_back(int(geometry->pointIndex(geometry->vertexPoint(vertex))));
                uvs.push_back(uv.isValid() ? uv.get(vertex) : UT_Vector3(0, 0, 0));
            }
        }
    }

    bool operator==(const Rest &o) const
    {
        return positions == o.positions && uvs == o.uvs && rigidity == o.rigidity && counts == o.counts &&
               points == o.points;
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
    void warp(const GU_Detail *rest_geometry, int cells, vrtm::Quality quality, UT_AutoInterrupt &interrupt);

    /* What the node keeps from cook to cook. A node is not cooked twice at the same time. */
    std::unique_ptr<Rest> rest_;
    vrtm::Asset asset_;
};

PRM_Template *SOP_VrtmWarp::templates()
{
    static PRM_Name names[] = {PRM_Name("grid", "Grid"), PRM_Name("quality", "Quality")};
    static PRM_Name qualities[] = {PRM_Name("normal", "Normal"), PRM_Name("draft", "Draft"), PRM_Name("high", "High"),
                                   PRM_Name()};
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
        warp(rest_geometry, int(evalInt("grid", 0, time)), vrtm::Quality(evalInt("quality", 0, time)), interrupt);
    } catch (const vrtm::Error &failed) {
        /* Of an interrupted cook Houdini tells itself. */
        if (failed.code() != vrtm::Code::cancelled) {
            addError(SOP_MESSAGE, failed.what());
        }
    }
    return error();
}

void SOP_VrtmWarp::warp(const GU_Detail *rest_geometry, int cells, vrtm::Quality quality, UT_AutoInterrupt &interrupt)
{
    Rest rest(rest_geometry);
    if (rest_ == nullptr || !(*rest_ == rest)) {
        rest_.reset();
        vrtm::Mesh mesh(vrtm::Array::of<float>(rest.positions.data(), rest.positions.size()), rest.points);
        mesh.face_counts(rest.counts).uvs(vrtm::Array::of<float>(rest.uvs.data(), rest.uvs.size()));
        asset_ = vrtm::Asset::create(device(), mesh).value();
        asset_.set_vertex_rigidity(vrtm::Array(rest.rigidity.data(), rest.rigidity.size())).value();
        rest_.reset(new Rest(std::move(rest)));
    }
    for (const vrtm::Tile tile : asset_.tiles().value()) {
        vrtm::TileSettings settings;
        settings.grid_width = settings.grid_height = std::uint32_t(cells);
        /* Of no effect if they are the same as before. */
        tile.set_settings(settings).value();
    }
    vrtm::SolveOptions options;
    options.set(quality).set_progress(
        [&interrupt](float) { return interrupt.wasInterrupted() ? vrtm::Proceed::no : vrtm::Proceed::yes; });
    const std::vector<UT_Vector3> positions = positions_of(gdp);
    asset_.solve(vrtm::Array::of<float>(positions.data(), positions.size()), options).value();

    /* The input's topology is that of the rest geometry, and so are the offsets of its vertices. */
    std::vector<float> uvs(2 * rest_->vertices.size());
    asset_.corner_uvs(uvs.data(), rest_->vertices.size()).value();
    const GA_RWHandleV3 uv(gdp->addFloatTuple(GA_ATTRIB_VERTEX, "uv", 3));
    for (std::size_t corner = 0; corner < rest_->vertices.size(); ++corner) {
        uv.set(rest_->vertices[corner], UT_Vector3(uvs[2 * corner], uvs[2 * corner + 1], 0));
    }
}

} // namespace

void newSopOperator(OP_OperatorTable *table)
{
    table->addOperator(new OP_Operator("vrtm_warp", "VRTM Warp", SOP_VrtmWarp::create, SOP_VrtmWarp::templates(), 2, 2));
}
