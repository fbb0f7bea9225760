/*
 * vrtm for C++17: the handles of vrtm.h as objects that end themselves, and errors as exceptions.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Nothing here adds to what vrtm.h says: it is the manual. Structs are those of vrtm.h. Every function that can fail
 * throws vrtm::Error, with the status and the message of the failed call.
 */

#ifndef VRTM_HPP
#define VRTM_HPP

#include "vrtm.h"

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

namespace vrtm {

/// A call that failed.
class Error : public std::runtime_error {
public:
    Error(vrtm_status status, const char *message) : std::runtime_error(message), status_(status) {}
    vrtm_status status() const noexcept { return status_; }

private:
    vrtm_status status_;
};

/// Throws unless `status` is VRTM_OK. Call it on the thread that made the call.
inline void check(vrtm_status status)
{
    if (status != VRTM_OK) {
        throw Error(status, vrtm_last_error());
    }
}

/// Packed vectors, or those with a stride in bytes, as an argument. The memory stays the caller's.
inline vrtm_array array(const float *data, std::size_t count, std::size_t stride = 0)
{
    vrtm_array a = vrtm_array_init();
    a.data = data;
    a.count = count;
    a.stride = stride;
    return a;
}

inline vrtm_array array(const double *data, std::size_t count, std::size_t stride = 0)
{
    vrtm_array a = vrtm_array_init();
    a.format = VRTM_SCALAR_F64;
    a.data = data;
    a.count = count;
    a.stride = stride;
    return a;
}

/// A packed input image, first row on top. The memory stays the caller's.
inline vrtm_image image(const void *data, std::uint32_t width, std::uint32_t height, vrtm_pixel_format format)
{
    vrtm_image i = vrtm_image_init();
    i.data = data;
    i.width = width;
    i.height = height;
    i.format = format;
    return i;
}

/// A packed output image of 2 * width * height floats, first row on top. The memory stays the caller's.
inline vrtm_image_out image_out(float *data, std::uint32_t width, std::uint32_t height)
{
    vrtm_image_out i = vrtm_image_out_init();
    i.data = data;
    i.width = width;
    i.height = height;
    return i;
}

/// The GPUs that a device can be made on; vrtm_device_desc::adapter is an index into it.
inline std::vector<vrtm_adapter_data> adapters()
{
    std::uint32_t count = 0;
    check(vrtm_adapter_count(&count));
    std::vector<vrtm_adapter_data> adapters(count, vrtm_adapter_data_init());
    for (std::uint32_t i = 0; i < count; ++i) {
        check(vrtm_adapter_info(i, &adapters[i]));
    }
    return adapters;
}

/// Where assets are solved. Assets may outlive it.
class Device {
public:
    explicit Device(const vrtm_device_desc *desc = nullptr) { check(vrtm_device_create(desc, &handle_)); }
    ~Device() { reset(); }
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;
    Device(Device &&other) noexcept : handle_(std::exchange(other.handle_, vrtm_device{})) {}
    Device &operator=(Device &&other) noexcept
    {
        std::swap(handle_, other.handle_);
        return *this;
    }

    vrtm_device handle() const noexcept { return handle_; }

    vrtm_device_data info() const
    {
        vrtm_device_data data = vrtm_device_data_init();
        check(vrtm_device_info(handle_, &data));
        return data;
    }

private:
    void reset() noexcept
    {
        if (handle_.id != 0) {
            vrtm_device_destroy(handle_);
        }
    }

    vrtm_device handle_{};
};

/// A tile of an asset: a plain handle that ends with the asset.
class Tile {
public:
    Tile() = default;
    explicit Tile(vrtm_tile handle) noexcept : handle_(handle) {}

    vrtm_tile handle() const noexcept { return handle_; }

    vrtm_tile_data info() const
    {
        vrtm_tile_data data = vrtm_tile_data_init();
        check(vrtm_tile_info(handle_, &data));
        return data;
    }

    void set_rigidity(const vrtm_image *rigidity) const { check(vrtm_tile_set_rigidity(handle_, rigidity)); }
    void update_rigidity(const vrtm_image &rigidity, std::uint32_t x, std::uint32_t y, std::uint32_t width,
                         std::uint32_t height) const
    {
        check(vrtm_tile_update_rigidity(handle_, &rigidity, x, y, width, height));
    }
    void set_mask(const vrtm_image *mask) const { check(vrtm_tile_set_mask(handle_, mask)); }
    void set_settings(const vrtm_tile_settings &settings) const
    {
        check(vrtm_tile_set_settings(handle_, &settings));
    }

    vrtm_tile_settings settings() const
    {
        vrtm_tile_settings settings = vrtm_tile_settings_init();
        check(vrtm_tile_get_settings(handle_, &settings));
        return settings;
    }

    void fetch(vrtm_fetch_kind kind, const vrtm_image_out &image) const
    {
        check(vrtm_tile_fetch(handle_, kind, &image));
    }

    void fetch_part(vrtm_fetch_kind kind, const vrtm_image_out &image, std::uint32_t x, std::uint32_t y,
                    std::uint32_t width, std::uint32_t height) const
    {
        check(vrtm_tile_fetch_part(handle_, kind, &image, x, y, width, height));
    }

    vrtm_tile_needs estimate() const
    {
        vrtm_tile_needs needs = vrtm_tile_needs_init();
        check(vrtm_tile_estimate(handle_, &needs));
        return needs;
    }

    /// The prepared tile, for load().
    std::vector<unsigned char> save() const
    {
        std::size_t size = 0;
        check(vrtm_tile_save(handle_, nullptr, 0, &size));
        std::vector<unsigned char> data(size);
        check(vrtm_tile_save(handle_, data.data(), data.size(), &size));
        return data;
    }

    void load(const std::vector<unsigned char> &data) const
    {
        check(vrtm_tile_load(handle_, data.data(), data.size()));
    }

    vrtm_tile_report_data report() const
    {
        vrtm_tile_report_data report = vrtm_tile_report_data_init();
        check(vrtm_tile_report(handle_, &report));
        return report;
    }

private:
    vrtm_tile handle_{};
};

/// One mesh with its tiles.
class Asset {
public:
    Asset(const Device &device, const vrtm_mesh_desc &mesh)
    {
        check(vrtm_asset_create(device.handle(), &mesh, &handle_));
    }
    ~Asset() { reset(); }
    Asset(const Asset &) = delete;
    Asset &operator=(const Asset &) = delete;
    Asset(Asset &&other) noexcept : handle_(std::exchange(other.handle_, vrtm_asset{})) {}
    Asset &operator=(Asset &&other) noexcept
    {
        std::swap(handle_, other.handle_);
        return *this;
    }

    vrtm_asset handle() const noexcept { return handle_; }

    vrtm_asset_data info() const
    {
        vrtm_asset_data data = vrtm_asset_data_init();
        check(vrtm_asset_info(handle_, &data));
        return data;
    }

    /// All tiles: those of UV set 0 in the order of their UDIM numbers, then those of set 1, and so on.
    std::vector<Tile> tiles() const
    {
        std::uint32_t count = 0;
        check(vrtm_asset_tile_count(handle_, &count));
        std::vector<Tile> tiles;
        for (std::uint32_t i = 0; i < count; ++i) {
            vrtm_tile tile{};
            check(vrtm_asset_tile(handle_, i, &tile));
            tiles.emplace_back(tile);
        }
        return tiles;
    }

    Tile find_tile(std::uint32_t udim, std::uint32_t uv_set = 0) const
    {
        vrtm_tile tile{};
        check(vrtm_asset_find_tile_of_set(handle_, uv_set, udim, &tile));
        return Tile(tile);
    }

    void set_vertex_rigidity(const vrtm_array *rigidity) { check(vrtm_asset_set_vertex_rigidity(handle_, rigidity)); }

    void solve(const vrtm_array &positions, const vrtm_solve_options *options = nullptr)
    {
        check(vrtm_asset_solve(handle_, &positions, options));
    }

    void redirect(const vrtm_array &positions, const std::vector<vrtm_fetch> &fetches,
                  const vrtm_solve_options *options = nullptr)
    {
        check(vrtm_asset_redirect(handle_, &positions, options, fetches.data(), fetches.size()));
    }

    /// One pair (u, v) per face corner.
    std::vector<float> corner_uvs(std::uint32_t uv_set = 0) const
    {
        const auto corners = static_cast<std::size_t>(info().corners);
        std::vector<float> uvs(2 * corners);
        check(vrtm_asset_fetch_corner_uvs_of_set(handle_, uv_set, uvs.data(), corners));
        return uvs;
    }

    vrtm_asset_report_data report() const
    {
        vrtm_asset_report_data report = vrtm_asset_report_data_init();
        check(vrtm_asset_report(handle_, &report));
        return report;
    }

private:
    void reset() noexcept
    {
        if (handle_.id != 0) {
            vrtm_asset_destroy(handle_);
        }
    }

    vrtm_asset handle_{};
};

} // namespace vrtm

#endif // VRTM_HPP
