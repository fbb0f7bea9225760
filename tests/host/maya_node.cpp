/*
 * A host that drives the node of maya_plugin.cpp as Maya drives a deformer: attributes that make outputs dirty, lazy
 * pulls, a cache of frames that is filled in the background while the user scrubs, evaluation on the host's threads,
 * duplicates, undo, deletion and unloading while the node computes. The plug-in's path is the program's first argument;
 * the second one says how often it is loaded and unloaded, 100 times without it. The host itself is not linked to the
 * library.
 */

#include "platform.h"

#include "check.h"

#include "host_pool.hpp"
#include "maya_plugin.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <random>
#include <string>
#include <thread>

namespace {

const int frames = 12;
sheet s;
std::atomic<int> errors{0};

using Result = std::shared_ptr<const Output>;

bool same(const Result &a, const Result &b)
{
    return a && b && a->redirection.size() == b->redirection.size() && !a->redirection.empty() &&
           std::memcmp(a->redirection.data(), b->redirection.data(), a->redirection.size() * sizeof(float)) == 0;
}

/* The plug-in, loaded. */
class Library {
public:
    Library(const char *path, const Host &host) : library_(platform_load(path))
    {
        InitializePlugin initialize = nullptr;
        if (library_ != nullptr) {
            *reinterpret_cast<void **>(&initialize) = platform_symbol(library_, "initialize_plugin");
            *reinterpret_cast<void **>(&uninitialize_) = platform_symbol(library_, "uninitialize_plugin");
        }
        plugin_ = initialize != nullptr ? initialize(host) : nullptr;
    }
    ~Library()
    {
        if (plugin_ != nullptr) {
            uninitialize_(plugin_);
        }
        if (library_ != nullptr) {
            platform_unload(library_);
        }
    }
    Library(const Library &) = delete;
    Library &operator=(const Library &) = delete;

    Plugin *operator->() const { return plugin_; }
    explicit operator bool() const { return plugin_ != nullptr; }

private:
    void *library_;
    Plugin *plugin_ = nullptr;
    UninitializePlugin uninitialize_ = nullptr;
};

/* What a user sets. */
struct Attributes {
    std::shared_ptr<const MeshData> mesh;
    std::shared_ptr<const MapData> rigidity, mask;
    std::shared_ptr<const SettingsData> settings;
};

/* A node in the host's graph: its attributes, and the frames that are computed and not dirty. */
class DependencyNode {
public:
    DependencyNode(const Library &library, const Attributes &attributes)
        : node_(library->create_node()), attributes_(attributes)
    {
    }

    Attributes attributes() const
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        return attributes_;
    }

    /* Sets attributes: all frames are dirty, and what is being computed is of no use. Computes nothing. */
    void set(const Attributes &attributes)
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        attributes_ = attributes;
        version_ += 1;
        cache_.clear();
    }

    /* Before the node is deleted: without attributes nothing is computed any more. */
    void disconnect() { set({}); }

    /* The output at a frame; null if it was interrupted, or became dirty meanwhile. */
    Result pull(int frame)
    {
        DataBlock in;
        int version = 0;
        {
            const std::lock_guard<std::mutex> lock(mutex_);
            if (attributes_.mesh == nullptr) {
                return nullptr;
            }
            const auto cached = cache_.find(frame);
            if (cached != cache_.end()) {
                return cached->second;
            }
            in = DataBlock{attributes_.mesh, attributes_.rigidity, attributes_.mask, attributes_.settings, {}, {}};
            version = version_;
        }
        in.points.resize(4 * VERTICES);
        sheet_pose(&s, frame, reinterpret_cast<double(*)[4]>(in.points.data()));
        in.interrupted = [this, version] { return version_ != version; };
        const auto out = std::make_shared<Output>();
        computes += 1;
        const Computed computed = node_->compute(in, *out);
        interrupts += computed == Computed::interrupted;
        const std::lock_guard<std::mutex> lock(mutex_);
        if (computed != Computed::good || version != version_) {
            return nullptr;
        }
        return cache_[frame] = out;
    }

    std::size_t cached() const
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        return cache_.size();
    }
    void flush_cache()
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        cache_.clear();
    }

    std::atomic<int> computes{0}, interrupts{0};

private:
    const std::unique_ptr<Node> node_;
    mutable std::mutex mutex_;
    Attributes attributes_;
    std::atomic<int> version_{0};
    std::map<int, Result> cache_;
};

Attributes attributes_at_first()
{
    const auto mesh = std::make_shared<MeshData>();
    mesh->points.assign(&s.points[0][0], &s.points[0][0] + 4 * VERTICES);
    mesh->counts.assign(s.counts, s.counts + FACES);
    mesh->connects.assign(s.indices, s.indices + CORNERS);
    mesh->uv_ids = mesh->connects;
    for (const float(&uv)[2] : s.uvs) {
        mesh->u.push_back(uv[0]);
        mesh->v.push_back(uv[1]);
    }
    const auto map = std::make_shared<MapData>();
    map->texels.assign(&s.rigidity[0][0], &s.rigidity[0][0] + MAP * MAP);
    map->width = map->height = MAP;
    return {mesh, map, nullptr, std::make_shared<SettingsData>(SettingsData{128, false})};
}

/* The attributes after a stroke of a brush. */
Attributes painted(Attributes attributes)
{
    const auto map = std::make_shared<MapData>(*attributes.rigidity);
    std::fill(map->texels.begin() + 20 * MAP, map->texels.begin() + 26 * MAP, std::uint8_t(255));
    attributes.rigidity = map;
    return attributes;
}

Attributes with_settings(Attributes attributes, unsigned grid, bool draft)
{
    attributes.settings = std::make_shared<SettingsData>(SettingsData{grid, draft});
    return attributes;
}

std::vector<Result> in_order(DependencyNode &node)
{
    std::vector<Result> results;
    for (int frame = 0; frame < frames; ++frame) {
        results.push_back(node.pull(frame));
    }
    return results;
}

bool all_same(const std::vector<Result> &a, const std::vector<Result> &b)
{
    return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), same);
}

std::vector<int> shuffled(unsigned seed)
{
    std::vector<int> order(frames);
    for (int i = 0; i < frames; ++i) {
        order[std::size_t(i)] = i;
    }
    std::shuffle(order.begin(), order.end(), std::mt19937(seed));
    return order;
}

void lazy(const Library &library, const std::vector<Result> &expected)
{
    DependencyNode node(library, attributes_at_first());
    const Attributes first = node.attributes();
    node.set(painted(first));
    node.set(with_settings(first, 64, true));
    node.set(first);
    check_that(node.computes == 0, "setting attributes computes nothing", "");
    check_that(same(node.pull(5), expected[5]) && node.computes == 1, "a pull computes its frame", "");
    check_that(same(node.pull(5), expected[5]) && node.computes == 1, "once", "");
    node.set(painted(first));
    const Result other = node.pull(5);
    check_that(other && !same(other, expected[5]) && node.computes == 2, "another map makes it dirty", "");
    Attributes masked = first;
    const auto mask = std::make_shared<MapData>(*first.rigidity);
    std::fill(mask->texels.begin(), mask->texels.begin() + MAP * MAP / 2, std::uint8_t(0));
    masked.mask = mask;
    node.set(masked);
    const Result held = node.pull(5);
    check_that(held && !same(held, expected[5]) && !same(held, other), "and so does a mask", "");
    node.set(with_settings(first, 128, true));
    const Result draft = node.pull(5);
    check_that(draft && !same(draft, expected[5]), "and another quality", "");
    node.set(first);
    check_that(same(node.pull(5), expected[5]), "undo brings the old result back", "");
}

/* The background fills the cache while the user scrubs, and paints once. */
void cached_playback(const Library &library, const std::vector<Result> &expected, const std::vector<Result> &after)
{
    DependencyNode node(library, attributes_at_first());
    const Attributes first = node.attributes();
    std::atomic<bool> ended{false};
    std::atomic<int> rounds{0};
    std::thread background([&] {
        for (unsigned seed = 0; !ended; ++seed) {
            for (int frame : shuffled(seed)) {
                node.pull(frame);
            }
            rounds += 1;
        }
    });
    std::mt19937 random(1);
    int wrong = 0, pulls = 0;
    /* Before the stroke, after it, and after its undo. */
    for (int phase = 0; phase < 3; ++phase) {
        node.set(phase == 1 ? painted(first) : first);
        const int until = rounds + 3;
        for (int i = 0; i < 100 || rounds < until; ++i) {
            const std::size_t frame = random() % frames;
            if (i % 16 == 0) {
                node.flush_cache();
            }
            wrong += !same(node.pull(int(frame)), phase == 1 ? after[frame] : expected[frame]);
            pulls += 1;
        }
    }
    ended = true;
    background.join();
    const std::string detail = std::to_string(wrong) + " of " + std::to_string(pulls) + " wrong";
    check_that(wrong == 0, "scrubbing while the background computes: the bits of frames in order", detail.c_str());
    check_that(all_same(in_order(node), expected), "and so is the cache", "");
}

/* Nodes evaluated by the host's threads. No other thread comes to be. */
void parallel_evaluation(const Library &library, HostPool &pool, const std::vector<Result> &expected)
{
    const std::size_t count = 64;
    std::vector<std::unique_ptr<DependencyNode>> nodes;
    for (std::size_t i = 0; i < count; ++i) {
        nodes.push_back(std::make_unique<DependencyNode>(library, attributes_at_first()));
    }
    const long before = long(platform_threads());
    std::atomic<long> most{0};
    std::atomic<int> wrong{0}, left{int(count)};
    for (std::size_t i = 0; i < count; ++i) {
        pool.spawn([&, i] {
            for (std::size_t k = 0; k < 3; ++k) {
                const std::size_t frame = (i + 5 * k) % frames;
                wrong += !same(nodes[i]->pull(int(frame)), expected[frame]);
            }
            left -= 1;
        });
    }
    /* The host's main thread looks on. */
    while (left > 0) {
        most = std::max(most.load(), long(platform_threads()));
        std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    const std::string threads = std::to_string(most.load()) + " threads at most, " + std::to_string(before) + " before";
    check_that(wrong == 0, "64 nodes on the host's two threads give the bits of one alone", "");
    check_that(before == 3 && most == before, ("without any other thread: " + threads).c_str(), threads.c_str());
}

/* A large grid, so that there is time to do something meanwhile. */
Attributes slow(const Attributes &attributes) { return with_settings(attributes, 1024, false); }

/* Waits until another thread is computing. */
void wait_for_compute(const DependencyNode &node, int computes)
{
    while (node.computes < computes) {
        std::this_thread::yield();
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(15));
}

void edits_while_computing(const Library &library, const std::vector<Result> &expected)
{
    DependencyNode node(library, slow(attributes_at_first()));
    const Attributes large = node.attributes(), small = attributes_at_first();
    const auto began = std::chrono::steady_clock::now();
    const Result whole = node.pull(5);
    const std::chrono::duration<double, std::milli> all = std::chrono::steady_clock::now() - began;
    check_that(whole && !same(whole, expected[5]), "a large grid", "");
    Result stale;

    node.set(painted(large));
    std::thread other([&] { stale = node.pull(5); });
    wait_for_compute(node, 2);
    node.set(large);
    const auto start = std::chrono::steady_clock::now();
    other.join();
    const std::chrono::duration<double, std::milli> left = std::chrono::steady_clock::now() - start;
    const std::string name = "undo while computing interrupts it: " + std::to_string(left.count()) + " ms, not " +
                             std::to_string(all.count());
    check_that(!stale && node.interrupts == 1 && left < all, name.c_str(), name.c_str());
    check_that(same(node.pull(5), whole), "and the next pull has the old bits", "");

    /* A duplicate has the attributes, and nothing else. */
    node.flush_cache();
    const int computes = node.computes;
    other = std::thread([&] { stale = node.pull(5); });
    wait_for_compute(node, computes + 1);
    DependencyNode duplicate(library, node.attributes());
    const Result twin = duplicate.pull(5);
    other.join();
    check_that(same(stale, whole) && same(twin, whole), "a duplicate made while computing, and the original", "");

    /* Deleted while another thread computes: the host interrupts that, waits for it, and deletes the node. */
    auto doomed = std::make_unique<DependencyNode>(library, large);
    other = std::thread([&] { stale = doomed->pull(7); });
    wait_for_compute(*doomed, 1);
    doomed->disconnect();
    other.join();
    check_that(!stale && doomed->interrupts == 1, "a node that is to be deleted is interrupted", "");
    doomed.reset();
    node.set(small);
    check_that(same(node.pull(7), expected[7]), "and the others go on", "");
}

void scene_unload(const Library &library, HostPool &pool)
{
    std::vector<std::unique_ptr<DependencyNode>> nodes;
    std::atomic<int> left{0};
    for (int i = 0; i < 6; ++i) {
        nodes.push_back(std::make_unique<DependencyNode>(library, slow(attributes_at_first())));
        left += 1;
        pool.spawn([&left, &node = *nodes.back()] {
            node.pull(3);
            left -= 1;
        });
    }
    while (library->bytes_held() == 0) {
        std::this_thread::yield();
    }
    const int unfinished = left;
    for (auto &node : nodes) {
        node->disconnect();
    }
    while (left > 0) {
        std::this_thread::yield();
    }
    nodes.clear();
    const std::string detail = std::to_string(unfinished) + " of 6, " + std::to_string(library->bytes_held()) + " bytes";
    check_that(unfinished > 0 && library->bytes_held() == 0, "a scene is unloaded while it computes, and nothing is left",
               detail.c_str());
}

/* Loaded and unloaded again and again, with solves in between. */
void reload(const char *path, const Host &host, const std::vector<Result> &expected, int rounds)
{
    int wrong = 0, mapped = 0;
    long memory = 0, threads = long(platform_threads());
    for (int round = 0; round < rounds; ++round) {
        {
            const Library library(path, host);
            if (!library) {
                check_that(0, "load the plug-in", platform_load_error());
                return;
            }
            DependencyNode node(library, attributes_at_first());
            const std::size_t frame = std::size_t(round % frames);
            wrong += !same(node.pull(int(frame)), expected[frame]);
        }
        mapped += platform_is_mapped("vrtm.") || platform_is_mapped("maya_plugin");
        if (round == rounds / 5 - 1) {
            memory = platform_memory();
        }
    }
    const long grown = platform_memory() - memory;
    const std::string detail = std::to_string(grown) + " KiB", times = std::to_string(rounds) + " times";
    check_that(wrong == 0, ("the plug-in is loaded and unloaded " + times + ", and computes the same bits").c_str(), "");
    check_that(mapped == 0, "after each unload nothing of it is in memory", std::to_string(mapped).c_str());
    check_that(long(platform_threads()) == threads, "it leaves no thread", "");
#if defined(_WIN32)
    /* The plug-in has a libstdc++ of its own, which takes 72 KiB at each load, to throw exceptions from when memory is short. */
    const long limit = 1024 + 80 * rounds;
#else
    const long limit = 1024;
#endif
    check_that(grown < limit, ("nor memory: after the first fifth of these it grew by " + detail).c_str(), detail.c_str());
}

} // namespace

int main(int count, char **arguments)
{
    const char *path = count > 1 ? arguments[1] : "";
    sheet_make(&s);
    Host host;
    host.display_error = [](const char *message) {
        errors += 1;
        std::printf("FAIL %s\n", message);
    };
    /* In order, on one thread, with the library's own threads. */
    std::vector<Result> expected, after;
    {
        const Library library(path, host);
        if (!check_that(bool(library), "load the plug-in", count > 1 ? platform_load_error() : "its path is missing")) {
            return finish();
        }
        DependencyNode node(library, attributes_at_first());
        expected = in_order(node);
        node.set(painted(node.attributes()));
        after = in_order(node);
        bool differ = true;
        for (std::size_t i = 1; i < expected.size(); ++i) {
            differ = differ && !same(expected[i], expected[i - 1]) && !same(expected[i], after[i]);
        }
        check_that(differ, "the frames differ", "");
        lazy(library, expected);
        cached_playback(library, expected, after);
        edits_while_computing(library, expected);
    }
    reload(path, host, expected, count > 2 ? std::atoi(arguments[2]) : 100);
    {
        HostPool pool(2);
        host.parallel_for = [&pool](std::size_t loops, const std::function<void(std::size_t)> &body) {
            pool.parallel_for(loops, body);
        };
        host.spawn = [&pool](const std::function<void()> &task) { pool.spawn(task); };
        const Library library(path, host);
        check_that(bool(library), "a plug-in on the host's threads", "");
        check_that(all_same(in_order(*std::make_unique<DependencyNode>(library, attributes_at_first())), expected),
                   "gives the same bits", "");
        parallel_evaluation(library, pool, expected);
        cached_playback(library, expected, after);
        scene_unload(library, pool);
    }
    check_that(errors == 0, "no node reported an error", "");
    return finish();
}
