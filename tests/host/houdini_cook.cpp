/*
 * A host that cooks as Houdini does: parameters that do not change during a cook, a cache object per node, several
 * threads that cook, an interrupt that is polled during a cook, and an output that is replaced only by a cook that
 * succeeded. The node moves the UVs of its input.
 */

#include "check.h"
#include "host_pool.hpp"
#include "vrtm.hpp"

#include <limits>
#include <string>

namespace {

sheet s;

/* As UT_Vector3: positions and UVs have three floats each. */
struct Vector3 {
    float x, y, z;
};

/* What flows from node to node. Data that did not change keeps its id. */
struct Detail {
    std::vector<Vector3> positions;
    std::vector<int> counts, points;
    std::vector<Vector3> uvs; /* per vertex of a primitive, as Houdini calls a corner */
    int topology_id = 1;
};
using ConstDetail = std::shared_ptr<const Detail>;

struct Map {
    std::vector<std::uint8_t> texels;
    int id = 1;
};

/* A cook's parameters: never changed. */
struct Parameters {
    std::shared_ptr<const Map> rigidity;
    std::uint32_t grid = 64;
    vrtm::Quality quality = vrtm::Quality::normal;
};

/* As UT_Interrupt: asked again and again, on the threads that cook. */
class Interrupt {
public:
    bool poll()
    {
        const int now = ++polls;
        return asked || (after > 0 && now >= after);
    }
    std::atomic<bool> asked{false};
    std::atomic<int> polls{0};
    int after = 0; /* at this poll; 0 = never */
};

/* What a node keeps from cook to cook. */
struct NodeCache {
    vrtm::Asset asset;
    vrtm::Tile tile;
    int topology_id = 0, map_id = 0;
    std::uint32_t grid = 0;
    int assets_made = 0;
};

/* What all nodes of the type share: const, and called by several threads at once, each with another cache. */
class Verb {
public:
    explicit Verb(vrtm::Device device) : device_(std::move(device)) {}

    /* The output, or an exception. */
    ConstDetail cook(NodeCache &cache, const Parameters &parameters, const ConstDetail &rest, const ConstDetail &posed,
                     Interrupt &interrupt) const
    {
        if (!cache.asset || cache.topology_id != rest->topology_id) {
            vrtm::Mesh mesh(vrtm::Array::of<float>(rest->positions.data(), rest->positions.size()), rest->points);
            mesh.face_counts(rest->counts).uvs(vrtm::Array::of<float>(rest->uvs.data(), rest->uvs.size()));
            vrtm::Asset asset = vrtm::Asset::create(device_, mesh).value();
            const int made = cache.assets_made + 1;
            const vrtm::Tile tile = asset.find_tile(1001).value();
            cache = NodeCache{std::move(asset), tile, rest->topology_id, 0, 0, made};
        }
        if (cache.map_id != parameters.rigidity->id) {
            cache.tile.set_rigidity({parameters.rigidity->texels.data(), MAP, MAP}).value();
            cache.map_id = parameters.rigidity->id;
        }
        if (cache.grid != parameters.grid) {
            vrtm::TileSettings settings;
            settings.grid_width = settings.grid_height = parameters.grid;
            cache.tile.set_settings(settings).value();
            cache.grid = parameters.grid;
        }
        vrtm::SolveOptions options;
        options.set(parameters.quality);
        options.set_progress([&interrupt](float) { return interrupt.poll() ? vrtm::Proceed::no : vrtm::Proceed::yes; });
        cache.asset.solve(vrtm::Array::of<float>(posed->positions.data(), posed->positions.size()), options).value();
        std::vector<float> uvs(2 * posed->uvs.size());
        cache.asset.corner_uvs(uvs.data(), posed->uvs.size()).value();

        const auto output = std::make_shared<Detail>(*posed);
        for (std::size_t i = 0; i < output->uvs.size(); ++i) {
            output->uvs[i] = {uvs[2 * i], uvs[2 * i + 1], 0};
        }
        return output;
    }

private:
    const vrtm::Device device_;
};

/* A node of a network: its output is that of the last cook that succeeded. */
struct SopNode {
    NodeCache cache;
    ConstDetail output;
    std::string error;
    bool interrupted = false;

    bool cook(const Verb &verb, const Parameters &parameters, const ConstDetail &rest, const ConstDetail &posed,
              Interrupt &interrupt)
    {
        error.clear();
        interrupted = false;
        try {
            output = verb.cook(cache, parameters, rest, posed, interrupt);
            return true;
        } catch (const vrtm::Error &failed) {
            interrupted = failed.code() == vrtm::Code::cancelled;
            error = failed.what();
            return false;
        }
    }
};

ConstDetail at_rest(int topology_id)
{
    const auto detail = std::make_shared<Detail>();
    for (const double(&p)[4] : s.points) {
        detail->positions.push_back({float(p[0]), float(p[1]), float(p[2])});
    }
    detail->counts.assign(s.counts, s.counts + FACES);
    detail->points.assign(s.indices, s.indices + CORNERS);
    for (const std::uint32_t point : s.indices) {
        detail->uvs.push_back({s.uvs[point][0], s.uvs[point][1], 0});
    }
    detail->topology_id = topology_id;
    return detail;
}

ConstDetail posed(const ConstDetail &rest, int frame)
{
    static thread_local double points[VERTICES][4];
    const auto detail = std::make_shared<Detail>(*rest);
    sheet_pose(&s, frame, points);
    for (std::size_t k = 0; k < VERTICES; ++k) {
        detail->positions[k] = {float(points[k][0]), float(points[k][1]), float(points[k][2])};
    }
    return detail;
}

bool same(const ConstDetail &a, const ConstDetail &b)
{
    return a && b && a->uvs.size() == b->uvs.size() &&
           std::memcmp(a->uvs.data(), b->uvs.data(), a->uvs.size() * sizeof(Vector3)) == 0;
}

Parameters parameters_at_first()
{
    const auto map = std::make_shared<Map>();
    map->texels.assign(&s.rigidity[0][0], &s.rigidity[0][0] + MAP * MAP);
    Parameters parameters;
    parameters.rigidity = map;
    return parameters;
}

/* What a cook alone gives for each frame. */
std::vector<ConstDetail> alone(const Verb &verb, const Parameters &parameters, const ConstDetail &rest, int frames)
{
    std::vector<ConstDetail> outputs;
    SopNode node;
    Interrupt interrupt;
    for (int frame = 0; frame < frames; ++frame) {
        check_that(node.cook(verb, parameters, rest, posed(rest, frame), interrupt), "a cook", node.error.c_str());
        outputs.push_back(node.output);
    }
    return outputs;
}

void caching(const Verb &verb, const std::vector<ConstDetail> &expected)
{
    const ConstDetail rest = at_rest(1), edited = at_rest(2);
    Parameters parameters = parameters_at_first();
    SopNode node;
    Interrupt interrupt;
    for (int frame : {4, 1, 4}) {
        node.cook(verb, parameters, rest, posed(rest, frame), interrupt);
        check_that(same(node.output, expected[std::size_t(frame)]), "frames in any order", node.error.c_str());
    }
    check_that(node.cache.assets_made == 1, "one asset serves all frames", "");
    const auto painted = std::make_shared<Map>(*parameters.rigidity);
    std::fill(painted->texels.begin(), painted->texels.begin() + 20 * MAP, std::uint8_t(255));
    painted->id = 2;
    const Parameters first = parameters;
    parameters.rigidity = painted;
    check_that(node.cook(verb, parameters, rest, posed(rest, 4), interrupt) && !same(node.output, expected[4]) &&
                   node.cache.assets_made == 1,
               "another map, on the same asset", node.error.c_str());
    check_that(node.cook(verb, first, edited, posed(edited, 4), interrupt) && node.cache.assets_made == 2,
               "another topology, and another asset", node.error.c_str());
    check_that(same(node.output, expected[4]), "whose result is the same, since the mesh is", "");
}

void interrupts(const Verb &verb)
{
    const ConstDetail rest = at_rest(1);
    Parameters parameters = parameters_at_first();
    parameters.grid = 1024;
    SopNode node;
    Interrupt patient;
    check_that(node.cook(verb, parameters, rest, posed(rest, 4), patient), "a long cook", node.error.c_str());
    check_that(patient.polls > 1, "polls the interrupt", "");
    const ConstDetail last = node.output;
    for (int after : {1, 2, 4}) {
        Interrupt interrupt;
        interrupt.after = after;
        const bool cooked = node.cook(verb, parameters, rest, posed(rest, 9), interrupt);
        check_that(!cooked && node.interrupted, "an interrupt at a poll ends the cook", node.error.c_str());
        check_that(node.output == last && interrupt.polls == after, "publishes nothing, and polls no more", "");
    }
    check_that(node.cook(verb, parameters, rest, posed(rest, 4), patient) && same(node.output, last),
               "the next cook has the bits of the first", node.error.c_str());

    /* Escape, pressed on another thread. */
    Interrupt interrupt;
    std::thread cooking([&] { node.cook(verb, parameters, rest, posed(rest, 9), interrupt); });
    while (interrupt.polls == 0) {
        std::this_thread::yield();
    }
    interrupt.asked = true;
    const int polls = interrupt.polls;
    cooking.join();
    /* A poll that has begun may look at the answer before it is given. */
    const std::string name = "Escape ends a cook at its next poll, the second at most";
    check_that(node.interrupted && interrupt.polls <= polls + 1, name.c_str(), std::to_string(interrupt.polls - polls).c_str());
}

void errors(const Verb &verb, const std::vector<ConstDetail> &expected)
{
    const ConstDetail rest = at_rest(1);
    const Parameters parameters = parameters_at_first();
    SopNode node;
    Interrupt interrupt;
    check_that(node.cook(verb, parameters, rest, posed(rest, 3), interrupt), "a cook", node.error.c_str());
    auto broken = std::make_shared<Detail>(*posed(rest, 4));
    broken->positions[17].y = std::numeric_limits<float>::quiet_NaN();
    check_that(!node.cook(verb, parameters, rest, broken, interrupt) && !node.interrupted &&
                   node.error.find("positions[17]") != std::string::npos,
               "a NaN in the input is an error that names it", node.error.c_str());
    check_that(same(node.output, expected[3]), "the output stays", "");
    check_that(node.cook(verb, parameters, rest, posed(rest, 4), interrupt) && same(node.output, expected[4]),
               "and the next cook succeeds", node.error.c_str());
}

/* Several threads cook different nodes at once, one of them interrupted now and then. */
void many_threads(const Verb &verb, HostPool &pool, const std::vector<ConstDetail> &expected)
{
    const std::size_t count = 16, rounds = 6;
    std::vector<SopNode> nodes(count);
    std::atomic<int> wrong{0}, stopped{0}, made{0};
    const ConstDetail rest = at_rest(1);
    const Parameters parameters = parameters_at_first();
    pool.parallel_for(count, [&](std::size_t i) {
        for (std::size_t k = 0; k < rounds; ++k) {
            const std::size_t frame = (3 * i + k) % expected.size();
            Interrupt interrupt;
            interrupt.after = (i + k) % 5 == 0 ? 1 : 0;
            const ConstDetail last = nodes[i].output;
            if (nodes[i].cook(verb, parameters, rest, posed(rest, int(frame)), interrupt)) {
                wrong += !same(nodes[i].output, expected[frame]);
            } else {
                stopped += 1;
                wrong += !nodes[i].interrupted || nodes[i].output != last;
            }
        }
        made += nodes[i].cache.assets_made;
    });
    check_that(wrong == 0, "16 nodes cooked by several threads give the bits of one alone", "");
    check_that(stopped > 0 && made == int(count), "some were interrupted, and no asset was made twice", "");
}

} // namespace

int main()
{
    sheet_make(&s);
    HostPool pool(3);
    try {
        vrtm::DeviceDesc desc;
        desc.set(vrtm::Backend::cpu);
        const Verb verb(vrtm::Device::create(desc).value());
        const std::vector<ConstDetail> expected = alone(verb, parameters_at_first(), at_rest(1), 8);
        check_that(!same(expected[2], expected[3]), "the frames differ", "");
        caching(verb, expected);
        interrupts(verb);
        errors(verb, expected);
        many_threads(verb, pool, expected);
    } catch (const vrtm::Error &error) {
        check_that(0, "no exception", error.what());
    }
    return finish();
}
