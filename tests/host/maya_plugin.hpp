/* Between the host and the plug-in: what Maya's data blocks, plug-in functions and log are to a node. */

#ifndef MAYA_PLUGIN_HPP
#define MAYA_PLUGIN_HPP

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

/* Attributes of a node. Their values never change; an attribute that is set anew gets another value. */
struct MeshData {
    std::vector<double> points; /* four per vertex */
    std::vector<int> counts, connects;
    std::vector<float> u, v;
    std::vector<int> uv_ids;
};
struct MapData {
    std::vector<std::uint8_t> texels;
    unsigned width, height;
};
struct SettingsData {
    unsigned grid;
    bool draft;
};

/* The inputs of one evaluation, at one frame. */
struct DataBlock {
    std::shared_ptr<const MeshData> mesh;
    std::shared_ptr<const MapData> rigidity, mask;
    std::shared_ptr<const SettingsData> settings;
    std::vector<double> points; /* the deformed ones, four per vertex */
    std::function<bool()> interrupted;
};

/* The output of one evaluation: a redirection map, two floats per texel. */
struct Output {
    unsigned size = 64;
    std::vector<float> redirection;
};

enum class Computed { good, interrupted, failed };

class Node {
public:
    virtual ~Node() = default;
    /* May be called by several threads at once: one for each context. */
    virtual Computed compute(const DataBlock &in, Output &out) = 0;
};

class Plugin {
public:
    virtual ~Plugin() = default;
    virtual std::unique_ptr<Node> create_node() = 0;
    /* Bytes that all nodes hold. */
    virtual std::uint64_t bytes_held() const = 0;
};

/* What the host offers. */
struct Host {
    /* The host's threads; empty if it has none to give. */
    std::function<void(std::size_t count, const std::function<void(std::size_t)> &body)> parallel_for;
    std::function<void(const std::function<void()> &task)> spawn;
    std::function<void(const char *)> display_error;
};

using InitializePlugin = Plugin *(*)(const Host &);
using UninitializePlugin = void (*)(Plugin *);

#endif
