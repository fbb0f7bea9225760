/*
 * A deformer node as Maya and Houdini drive one: created with its mesh, its maps set, then compute() for any frame in
 * any order, with double4 positions; several nodes evaluated at the same time from the host's threads.
 */

#include "check.h"
#include "vrtm.hpp"

#include <atomic>
#include <cmath>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

namespace {

const int frames = 12;
/* Frames out of order and with repeats, as when a user scrubs. */
const int shuffled[] = {7, 2, 11, 0, 5, 9, 1, 10, 4, 8, 3, 6, 6, 2};

struct Output {
    std::vector<float> redirection = std::vector<float>(2 * MAP * MAP);
    std::vector<float> warp = std::vector<float>(2 * (MAP + 1) * (MAP + 1));
    std::vector<float> corners;

    bool operator==(const Output &o) const
    {
        return same(redirection, o.redirection) && same(warp, o.warp) && same(corners, o.corners);
    }

    /* Compares bits: 0 and -0 differ. */
    static bool same(const std::vector<float> &a, const std::vector<float> &b)
    {
        return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
    }
};

class DeformerNode {
public:
    DeformerNode(const vrtm::Device &device, const sheet &mesh) : mesh_(mesh), asset_(make(device, mesh))
    {
        tile_ = asset_.find_tile(1001).value();
        vrtm::TileSettings settings;
        settings.grid_width = settings.grid_height = MAP;
        tile_.set_settings(settings).value();
        tile_.set_rigidity({&mesh_.rigidity[0][0], MAP, MAP}).value();
    }

    Output compute(int frame)
    {
        std::vector<double> points(4 * VERTICES);
        sheet_pose(&mesh_, frame, reinterpret_cast<double(*)[4]>(points.data()));
        Output output;
        asset_.redirect({points.data(), VERTICES, 4 * sizeof(double)},
                        {{tile_, {output.redirection.data(), MAP, MAP}},
                         {tile_, {output.warp.data(), MAP + 1, MAP + 1}, vrtm::FetchKind::warp}}).value();
        output.corners = asset_.corner_uvs().value();
        return output;
    }

    void paint(int offset)
    {
        sheet painted = mesh_;
        std::memmove(&painted.rigidity[0][0], &mesh_.rigidity[offset][0], sizeof(painted.rigidity) - offset * MAP);
        tile_.set_rigidity({&painted.rigidity[0][0], MAP, MAP}).value();
    }

    vrtm_tile_report report() const { return tile_.report().value(); }

private:
    static vrtm::Asset make(const vrtm::Device &device, const sheet &mesh)
    {
        sheet_desc desc;
        sheet_describe(&mesh, &desc);
        return vrtm::Asset::create(device, desc.mesh).value();
    }

    const sheet &mesh_;
    vrtm::Asset asset_;
    vrtm::Tile tile_;
};

bool any_difference(const std::vector<Output> &a, const std::vector<Output> &b)
{
    for (std::size_t i = 0; i < a.size(); ++i) {
        if (!(a[i] == b[i])) {
            return true;
        }
    }
    return a.size() != b.size();
}

std::vector<Output> in_order(DeformerNode &node)
{
    std::vector<Output> outputs;
    for (int frame = 0; frame < frames; ++frame) {
        outputs.push_back(node.compute(frame));
    }
    return outputs;
}

void one_node(const vrtm::Device &device, const sheet &mesh, const std::vector<Output> &expected)
{
    DeformerNode node(device, mesh);
    for (int round = 0; round < 2; ++round) {
        bool equal = true;
        bool sound = true;
        for (int frame : shuffled) {
            equal = equal && node.compute(frame) == expected[frame];
            const vrtm_tile_report report = node.report();
            sound = sound && report.folds == 0 && report.min_jacobian > 0;
        }
        check_that(equal, round == 0 ? "shuffled frames are the same bits" : "and so they are again", "");
        check_that(sound, "no frame folds", "");
    }
    bool differ = true;
    for (int frame = 1; frame < frames; ++frame) {
        differ = differ && !(expected[frame] == expected[frame - 1]);
    }
    check_that(differ, "the frames do differ", "");
    node.paint(4);
    const Output painted = node.compute(5);
    check_that(!(painted == expected[5]), "a new map changes the result", "");
    node.paint(0);
    check_that(node.compute(5) == expected[5], "the old map brings it back", "");
}

void thread_counts(const sheet &mesh, const std::vector<Output> &expected)
{
    for (std::uint32_t threads = 1; threads <= 5; threads += 2) {
        vrtm::DeviceDesc desc;
        desc.threads = threads;
        const vrtm::Device device = vrtm::Device::create(desc).value();
        DeformerNode node(device, mesh);
        char name[64];
        std::snprintf(name, sizeof name, "the same bits with %u threads", threads);
        check_that(!any_difference(in_order(node), expected), name, "");
    }
}

void many_nodes(const vrtm::Device &device, const sheet &mesh, const std::vector<Output> &expected)
{
    const int count = 6;
    std::vector<std::unique_ptr<DeformerNode>> nodes;
    for (int i = 0; i < count; ++i) {
        nodes.push_back(std::make_unique<DeformerNode>(device, mesh));
    }
    std::atomic<int> wrong{0};
    std::vector<std::thread> threads;
    for (int i = 0; i < count; ++i) {
        threads.emplace_back([&, i] {
            try {
                for (int frame : shuffled) {
                    const int mine = (frame + i) % frames;
                    wrong += nodes[i]->compute(mine) == expected[mine] ? 0 : 1;
                }
            } catch (const vrtm::Error &) {
                wrong += 1;
            }
        });
    }
    for (std::thread &thread : threads) {
        thread.join();
    }
    check_that(wrong == 0, "six nodes at once give the bits of one alone", "");
}

/*
 * Two threads use one asset at the same time. A host should not do this; if it does, one of the two calls fails with
 * VRTM_ERROR_BUSY, and nothing else happens.
 */
void one_node_twice(const vrtm::Device &device, const sheet &mesh, const std::vector<Output> &expected)
{
    DeformerNode node(device, mesh);
    std::atomic<int> good{0}, busy{0}, wrong{0};
    auto work = [&] {
        for (int frame : shuffled) {
            try {
                node.compute(frame);
                good += 1;
            } catch (const vrtm::Error &error) {
                (error.code() == vrtm::Code::busy ? busy : wrong) += 1;
            }
        }
    };
    std::thread first(work), second(work);
    first.join();
    second.join();
    char detail[64];
    std::snprintf(detail, sizeof detail, "%d good, %d busy, %d wrong", good.load(), busy.load(), wrong.load());
    check_that(wrong == 0 && good > 0, "two threads on one node: done or busy", detail);
    check_that(node.compute(4) == expected[4], "and the node is as good as before", "");
}

struct Nested {
    vrtm::Tile tile;
    std::atomic<int> calls{0}, refused{0};
};

void callbacks(const sheet &flat)
{
    /* The mesh overlaps itself in UV: the call that finds the overlap logs a warning. */
    sheet mesh = flat;
    for (float(&uv)[2] : mesh.uvs) {
        uv[0] = std::fmin(uv[0], 1 - uv[0]);
    }
    Nested nested{};
    /* A log function that calls back into the asset it was called for. */
    vrtm::DeviceDesc desc;
    desc.set_log([&nested](const vrtm_log_entry &) {
        nested.calls += 1;
        if (nested.tile && nested.tile.info().code() == vrtm::Code::busy) {
            nested.refused += 1;
        }
        vrtm::Device::create().value();
    });
    const vrtm::Device device = vrtm::Device::create(desc).value();
    sheet_desc d;
    sheet_describe(&mesh, &d);
    const vrtm::Asset asset = vrtm::Asset::create(device, d.mesh).value();
    nested.tile = asset.find_tile(1001).value();
    nested.tile.set_rigidity({&mesh.rigidity[0][0], MAP, MAP}).value();
    asset.solve({mesh.points, VERTICES}).value();
    check_that(nested.calls > 0, "a log function may call back", "");
    check_that(nested.refused > 0, "and finds the asset busy", "");
    check_that(nested.tile.info().value().overlap > 0, "which it is no longer then", "");
}

void raii(const vrtm::Device &device, const sheet &mesh)
{
    sheet_desc d;
    sheet_describe(&mesh, &d);
    vrtm::Asset first = vrtm::Asset::create(device, d.mesh).value();
    const vrtm_asset handle = first.handle();
    vrtm::Asset second(std::move(first));
    check_that(second.handle().id == handle.id && first.handle().id == 0, "an asset can be moved", "");
    check_that(second.tiles().value().size() == 1 && second.info().value().corners == CORNERS, "and still answers", "");
    bool thrown = false;
    try {
        second.find_tile(1099).value();
    } catch (const vrtm::Error &error) {
        thrown = error.code() == vrtm::Code::invalid_argument && std::strstr(error.what(), "udim") != nullptr;
    }
    check_that(thrown, "an error is an exception with its message", "");
    { const vrtm::Asset last(std::move(second)); }
    check_that(vrtm_asset_destroy(handle) == VRTM_ERROR_INVALID_HANDLE, "an asset ends with its object", "");
}

} // namespace

int main()
{
    try {
        static sheet mesh;
        sheet_make(&mesh);
        const vrtm::Device device = vrtm::Device::create().value();
        DeformerNode node(device, mesh);
        const std::vector<Output> expected = in_order(node);
        one_node(device, mesh, expected);
        thread_counts(mesh, expected);
        many_nodes(device, mesh, expected);
        one_node_twice(device, mesh, expected);
        callbacks(mesh);
        raii(device, mesh);
        check_that(device.info().value().bytes_held > 0, "the device counts what its assets hold", "");
    } catch (const vrtm::Error &error) {
        check_that(0, "no exception", error.what());
    }
    return finish();
}
