/*
 * Runs the SOP of examples/hosts/houdini with stand-ins of Houdini's classes: cooks that read no topology, paint that
 * makes no new asset, cooks that fail or are interrupted, stacked charts.
 */

#include "check.h"

#include <algorithm>
#include <cmath>
#include <limits>

/* Counts the assets that the node makes. */
static int assets_made;
static vrtm_status counted_asset_create(vrtm_device device, const vrtm_mesh_desc *desc, vrtm_asset *asset)
{
    assets_made += 1;
    return vrtm_asset_create(device, desc, asset);
}
#define vrtm_asset_create counted_asset_create
#include "../../../examples/hosts/houdini/SOP_VrtmWarp.cpp"
#undef vrtm_asset_create

namespace {

sheet s;
GA_DataId last_id;

/* Two sheets with vertices for each corner, one over the other in UV, posed if `frame` is over 0. The second of them is
 * posed as in a later frame. */
GU_Detail two_sheets(int frame)
{
    GU_Detail geometry;
    double points[VERTICES][4];
    for (int part = 0; part < 2; ++part) {
        sheet_pose(&s, frame == 0 ? 0 : frame + 2 * part, points);
        for (const auto &point : points) {
            const float x = float(point[0]) + 20 * float(part);
            geometry.stand_in_positions.stand_in.emplace_back(x, float(point[1]), float(point[2]));
        }
        for (int face = 0; face < FACES; ++face) {
            GA_Primitive primitive;
            for (int corner = 0; corner < 4; ++corner) {
                const std::uint32_t index = s.indices[4 * face + corner];
                primitive.stand_in_vertices.push_back(GA_Offset(geometry.stand_in_points.size()));
                geometry.stand_in_points.push_back(GA_Offset(index) + part * VERTICES);
                geometry.stand_in_attributes["uv"].stand_in.emplace_back(s.uvs[index][0], s.uvs[index][1], 0.0f);
            }
            geometry.stand_in_primitives.push_back(primitive);
        }
    }
    geometry.stand_in_positions.stand_in_id = ++last_id;
    geometry.stand_in_topology.stand_in_id = ++last_id;
    geometry.stand_in_attributes["uv"].stand_in_id = ++last_id;
    return geometry;
}

/* A disc of rigid points in each sheet. */
void paint(GU_Detail &geometry, float radius)
{
    GA_Attribute &rigidity = geometry.stand_in_attributes["rigidity"];
    rigidity.stand_in.clear();
    for (int k = 0; k < 2 * VERTICES; ++k) {
        const double *point = s.points[k % VERTICES];
        const bool rigid = std::hypot(point[0] - 5, point[1] - 5) < double(radius);
        rigidity.stand_in.emplace_back(rigid ? 1.0f : 0.0f, 0.0f, 0.0f);
    }
    rigidity.stand_in_id = ++last_id;
}

struct Node : SOP_VrtmWarp {
    Node() : SOP_VrtmWarp(nullptr, "vrtm", nullptr) { stand_in_values = {{"grid", 64}, {"quality", 0}}; }
    bool cook(GU_Detail &posed, GU_Detail &rest)
    {
        stand_in_inputs[0] = &posed;
        stand_in_inputs[1] = &rest;
        OP_Context context;
        return cookMySop(context) == UT_ERROR_NONE;
    }
    const std::vector<UT_Vector3> &uvs() { return stand_in_output.stand_in_attributes.at("uv").stand_in; }
    bool said(const char *text) { return stand_in_error.find(text) != std::string::npos; }
    void check(bool good, const char *name) { check_that(good, name, stand_in_error.c_str()); }
};

/* How far a sheet's corners have moved in UV, at most. */
float moved(GU_Detail &rest, const std::vector<UT_Vector3> &uvs, std::size_t part)
{
    float most = 0;
    for (std::size_t corner = part * CORNERS; corner < (part + 1) * CORNERS; ++corner) {
        const UT_Vector3 before = rest.stand_in_attributes.at("uv").stand_in[corner];
        most = std::max({most, std::fabs(uvs[corner](0) - before(0)), std::fabs(uvs[corner](1) - before(1))});
    }
    return most;
}

} // namespace

int main()
{
    sheet_make(&s);
    OP_OperatorTable table;
    newSopOperator(&table);
    check_that(table.stand_in_count == 1, "the operator is registered", "");

    GU_Detail rest = two_sheets(0), posed = two_sheets(3);
    Node node;
    node.check(node.cook(posed, rest) && !node.stand_in_warning.empty(), "without rigidity the user is warned");
    node.check(moved(rest, node.uvs(), 0) == 0, "and nothing moves");
    paint(rest, 3);
    node.check(node.cook(posed, rest) && node.stand_in_warning.empty(), "a painted sheet is cooked");
    node.check(moved(rest, node.uvs(), 0) > 1e-3f && moved(rest, node.uvs(), 1) > 1e-3f, "both stacked charts move");
    node.check(assets_made == 1 && rest.stand_in_reads == 1, "paint makes no new asset, and reads no topology");
    const std::vector<UT_Vector3> first = node.uvs();
    paint(rest, 2);
    node.check(node.cook(posed, rest) && !(node.uvs() == first), "other paint, another result");
    paint(rest, 3);
    node.check(node.cook(posed, rest) && node.uvs() == first && assets_made == 1, "the paint of before, its result");

    GU_Detail far = posed;
    for (UT_Vector3 &point : far.stand_in_positions.stand_in) {
        point = UT_Vector3(9 * point(0), 9 * point(1), 9 * point(2));
    }
    node.check(node.cook(far, rest) && !node.stand_in_warning.empty(), "the library's warnings reach the user");
    node.check(node.cook(posed, rest) && node.stand_in_warning.empty(), "until the pose is another");

    GU_Detail broken = posed;
    broken.stand_in_positions.stand_in[1] = UT_Vector3(std::numeric_limits<float>::quiet_NaN(), 0, 0);
    node.check(!node.cook(broken, rest), "a NaN fails");
    UT_AutoInterrupt::stand_in_pressed = true;
    GU_Detail other = two_sheets(4);
    node.check(node.cook(other, rest), "an interrupted cook is no error");
    UT_AutoInterrupt::stand_in_pressed = false;
    node.check(node.cook(posed, rest) && node.uvs() == first, "the next cook is as before");
    node.check(assets_made == 1 && rest.stand_in_reads == 1, "with the same asset");

    rest.stand_in_positions.stand_in_id = ++last_id;
    node.check(node.cook(posed, rest) && assets_made == 1 && rest.stand_in_reads == 2, "the same data, numbered anew");
    rest.stand_in_topology.stand_in_id = GA_INVALID_DATAID;
    node.check(node.cook(posed, rest) && node.cook(posed, rest) && rest.stand_in_reads == 4, "no number tells nothing");
    node.check(assets_made == 1 && node.uvs() == first, "but the data");
    rest.stand_in_positions.stand_in[0] = UT_Vector3(-1, 0, 0);
    node.check(node.cook(posed, rest) && assets_made == 2, "another rest geometry, another asset");

    GU_Detail fewer = posed;
    fewer.stand_in_primitives.pop_back();
    node.check(!node.cook(fewer, rest) && node.said("polygons"), "other polygons fail");
    rest.stand_in_attributes.erase("uv");
    node.check(!node.cook(posed, rest) && node.said("uv"), "missing UVs are told");
    return finish();
}
