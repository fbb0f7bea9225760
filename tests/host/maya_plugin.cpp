/*
 * A plug-in with a deformer's node as Maya has them: the worked example of docs/hosts.md. It is a shared library of its
 * own, which maya_node.cpp loads and unloads. Built without exceptions.
 */

#include "maya_plugin.hpp"
#include "vrtm.hpp"

#include <mutex>
#include <utility>

namespace {

/* An asset, and the attributes that it was given. */
struct Seat {
    vrtm::Asset asset;
    vrtm::Tile tile;
    std::shared_ptr<const MeshData> mesh;
    std::shared_ptr<const MapData> rigidity, mask;
    std::shared_ptr<const SettingsData> settings;
};

class WarpNode : public Node {
public:
    WarpNode(const vrtm::Device &device, const Host &host) : device_(device), host_(host) {}

    Computed compute(const DataBlock &in, Output &out) override
    {
        std::unique_ptr<Seat> seat = take_seat(in);
        vrtm::Result<> result = update(*seat, in);
        if (result) {
            result = solve(*seat, in, out);
        }
        give_back(std::move(seat));
        if (result.code() == vrtm::Code::cancelled) {
            return Computed::interrupted;
        }
        if (!result) {
            host_.display_error(result.message());
        }
        return result ? Computed::good : Computed::failed;
    }

private:
    /* Hands over what has changed since this asset was used last; of a mesh that has not changed, nothing. */
    vrtm::Result<> update(Seat &seat, const DataBlock &in)
    {
        if (seat.mesh != in.mesh) {
            const MeshData &m = *in.mesh;
            vrtm::Mesh mesh(vrtm::Array::of<4>(m.points), m.connects);
            mesh.face_counts(m.counts)
                .uvs(vrtm::Array::of<1>(m.u), vrtm::Array::of<1>(m.v))
                .uv_indices(m.uv_ids);
            vrtm::Result<vrtm::Asset> asset = vrtm::Asset::create(device_, mesh);
            if (!asset) {
                return asset;
            }
            const vrtm::Result<vrtm::Tile> tile = asset->find_tile(1001);
            if (!tile) {
                return tile;
            }
            seat = Seat{std::move(*asset), *tile, in.mesh, nullptr, nullptr, nullptr};
        }
        if (seat.rigidity != in.rigidity) {
            if (vrtm::Result<> result = set_map(in.rigidity, [&](auto map) { return seat.tile.set_rigidity(map); });
                !result) {
                return result;
            }
            seat.rigidity = in.rigidity;
        }
        if (seat.mask != in.mask) {
            if (vrtm::Result<> result = set_map(in.mask, [&](auto map) { return seat.tile.set_mask(map); }); !result) {
                return result;
            }
            seat.mask = in.mask;
        }
        if (seat.settings != in.settings) {
            vrtm::TileSettings settings;
            settings.grid_width = settings.grid_height = in.settings->grid;
            if (vrtm::Result<> result = seat.tile.set_settings(settings); !result) {
                return result;
            }
            seat.settings = in.settings;
        }
        return {};
    }

    template <class Set> static vrtm::Result<> set_map(const std::shared_ptr<const MapData> &map, const Set &set)
    {
        return map == nullptr ? set(nullptr) : set(vrtm::Image(map->texels.data(), map->width, map->height));
    }

    vrtm::Result<> solve(const Seat &seat, const DataBlock &in, Output &out)
    {
        vrtm::SolveOptions options;
        options.set(in.settings->draft ? vrtm::Quality::draft : vrtm::Quality::normal);
        options.set_progress(
            [&in](float) { return in.interrupted() ? vrtm::Proceed::no : vrtm::Proceed::yes; });
        std::vector<float> map(2 * std::size_t(out.size) * out.size);
        const vrtm::Array points = vrtm::Array::of<4>(in.points);
        vrtm::Result<> result =
            seat.asset.redirect(points, {{seat.tile, vrtm::ImageOut(map, out.size, out.size)}}, options);
        if (result) {
            out.redirection = std::move(map);
        }
        return result;
    }

    /*
     * An asset serves one solve at a time, and Maya may evaluate a node for several contexts at once: the foreground's
     * and the background's, which fills the cache of frames. So there are as many assets as evaluations at a time; which
     * of them computes a frame makes no difference to its bits. Best is one that has these very attributes.
     */
    std::unique_ptr<Seat> take_seat(const DataBlock &in)
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (free_.empty()) {
            return std::unique_ptr<Seat>(new Seat);
        }
        std::size_t best = free_.size() - 1;
        for (std::size_t i = 0; i < free_.size(); ++i) {
            if (free_[i]->mesh == in.mesh && free_[i]->rigidity == in.rigidity && free_[i]->mask == in.mask &&
                free_[i]->settings == in.settings) {
                best = i;
            }
        }
        std::swap(free_[best], free_.back());
        std::unique_ptr<Seat> seat = std::move(free_.back());
        free_.pop_back();
        return seat;
    }

    void give_back(std::unique_ptr<Seat> seat)
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        free_.push_back(std::move(seat));
    }

    const vrtm::Device &device_;
    const Host &host_;
    std::mutex mutex_;
    std::vector<std::unique_ptr<Seat>> free_;
};

/* The host's threads as an executor. */
struct Threads {
    const Host host;
    void parallel_for(std::size_t count, vrtm::Task task) { host.parallel_for(count, task); }
    void spawn(vrtm::Task task) { host.spawn([task] { task(); }); }
};

class WarpPlugin : public Plugin {
public:
    explicit WarpPlugin(const Host &host) : host_(host) {}

    vrtm::Result<> open()
    {
        vrtm::DeviceDesc desc;
        desc.set(vrtm::Backend::cpu);
        if (host_.parallel_for) {
            desc.threads = 2; /* as many as the host has */
            /* Not std::make_shared: with gcc it would keep this library in memory when it is unloaded. */
            desc.set_executor(std::shared_ptr<Threads>(new Threads{host_}));
        }
        vrtm::Result<vrtm::Device> device = vrtm::Device::create(desc);
        device_ = std::move(*device);
        return device;
    }

    std::unique_ptr<Node> create_node() override { return std::unique_ptr<Node>(new WarpNode(device_, host_)); }
    std::uint64_t bytes_held() const override { return device_.info()->bytes_held; }

private:
    const Host host_;
    vrtm::Device device_;
};

} // namespace

/* Once, when the host loads the plug-in. */
extern "C" Plugin *initialize_plugin(const Host &host)
{
    std::unique_ptr<WarpPlugin> plugin(new WarpPlugin(host));
    if (const vrtm::Result<> result = plugin->open(); !result) {
        host.display_error(result.message());
        return nullptr;
    }
    return plugin.release();
}

/* Once, when all nodes are gone, before the host unloads the plug-in. */
extern "C" void uninitialize_plugin(Plugin *plugin) { delete plugin; }
