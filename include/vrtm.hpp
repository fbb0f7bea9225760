/*
 * vrtm for C++17: the handles of vrtm.h as objects that end themselves, and its structs as values that own what they
 * point to.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Nothing here adds to what vrtm.h says: it is the manual. Every function that can fail returns a Result, which is true
 * if the call succeeded and otherwise has its status and its message. `solve(...).value()` throws vrtm::Error instead,
 * and is not there in a program that is built without exceptions. Functions that return a std::vector, take a
 * std::function or add to a list allocate as those do.
 *
 * Array, Image, ImageOut and Indices are views: the memory that they show stays the caller's, and must be there when
 * the library reads or writes it, which it does during the call.
 *
 * The names keep clear of the macros of windows.h, Xlib.h, Qt and macOS (min, ERROR, Status, emit, check).
 */

#ifndef VRTM_HPP
#define VRTM_HPP

#include "vrtm.h"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

// 1 if calls may throw. Define it as 0 before including the header to remove Result::value().
#if !defined(VRTM_EXCEPTIONS)
#if defined(__cpp_exceptions) || defined(_CPPUNWIND)
#define VRTM_EXCEPTIONS 1
#else
#define VRTM_EXCEPTIONS 0
#endif
#endif

#if VRTM_EXCEPTIONS
#include <stdexcept>
#endif

namespace vrtm {

// ---- The constants of vrtm.h ----

// A vrtm_status.
enum class Code : vrtm_status {
    ok = VRTM_OK,
    invalid_argument = VRTM_ERROR_INVALID_ARGUMENT,
    invalid_handle = VRTM_ERROR_INVALID_HANDLE,
    unsupported = VRTM_ERROR_UNSUPPORTED,
    out_of_memory = VRTM_ERROR_OUT_OF_MEMORY,
    not_solved = VRTM_ERROR_NOT_SOLVED,
    busy = VRTM_ERROR_BUSY,
    device_lost = VRTM_ERROR_DEVICE_LOST,
    internal = VRTM_ERROR_INTERNAL,
    cancelled = VRTM_ERROR_CANCELLED,
    timeout = VRTM_ERROR_TIMEOUT
};
enum class Scalar : vrtm_scalar { f32 = VRTM_SCALAR_F32, f64 = VRTM_SCALAR_F64 };
enum class PixelFormat : vrtm_pixel_format {
    f32 = VRTM_PIXEL_F32,
    f16 = VRTM_PIXEL_F16,
    u16 = VRTM_PIXEL_U16,
    u8 = VRTM_PIXEL_U8
};
enum class Origin : vrtm_origin { top = VRTM_ORIGIN_TOP, bottom = VRTM_ORIGIN_BOTTOM };
enum class Backend : vrtm_backend { automatic = VRTM_BACKEND_AUTO, cpu = VRTM_BACKEND_CPU, gpu = VRTM_BACKEND_GPU };
enum class Weld : vrtm_weld { index = VRTM_WELD_INDEX, position = VRTM_WELD_POSITION, off = VRTM_WELD_OFF };
enum class Overlap : vrtm_overlap { fixed = VRTM_OVERLAP_FIXED, first_face = VRTM_OVERLAP_FIRST_FACE };
enum class Seams : vrtm_seams { shut = VRTM_SEAMS_SHUT, go_on = VRTM_SEAMS_CONTINUE, keep = VRTM_SEAMS_KEEP };
enum class OpenBorders : vrtm_open_borders { fixed = VRTM_OPEN_BORDERS_FIXED, slide = VRTM_OPEN_BORDERS_SLIDE };
enum class FetchKind : vrtm_fetch_kind {
    redirection = VRTM_FETCH_REDIRECTION,
    redirection_delta = VRTM_FETCH_REDIRECTION_DELTA,
    warp = VRTM_FETCH_WARP,
    redirection_udim = VRTM_FETCH_REDIRECTION_UDIM,
    jacobian = VRTM_FETCH_JACOBIAN,
    filter_scale = VRTM_FETCH_FILTER_SCALE,
    uv_set = VRTM_FETCH_UV_SET,
    uv_set_delta = VRTM_FETCH_UV_SET_DELTA,
    carried = VRTM_FETCH_CARRIED // Fetches::add(carrier, ...) has it.
};
enum class Quality : vrtm_quality { normal = VRTM_QUALITY_NORMAL, draft = VRTM_QUALITY_DRAFT };
enum class Solver : vrtm_solver { descent = VRTM_SOLVER_DESCENT, pbd = VRTM_SOLVER_PBD };
enum class Bind : vrtm_bind { uv = VRTM_BIND_UV, corners = VRTM_BIND_CORNERS, nearest = VRTM_BIND_NEAREST };
enum class Fit : vrtm_fit { feature = VRTM_FIT_FEATURE, surface = VRTM_FIT_SURFACE, none = VRTM_FIT_NONE };
enum class PointState : vrtm_point_state {
    bound = VRTM_POINT_BOUND,
    outside = VRTM_POINT_OUTSIDE,
    folded = VRTM_POINT_FOLDED,
    far_off = VRTM_POINT_FAR // "far" is a macro of Windows.
};
enum class JobState : vrtm_job_state { running = VRTM_JOB_RUNNING, done = VRTM_JOB_DONE };

// The number of a constant in vrtm.h: `settings.overlap = vrtm::value(vrtm::Overlap::fixed)`. Convert a number back
// with `vrtm::Backend(info.backend)`.
template <class E, class = std::enable_if_t<std::is_enum<E>::value>>
constexpr std::underlying_type_t<E> value(E constant) noexcept
{
    return static_cast<std::underlying_type_t<E>>(constant);
}

// The name of a status, such as "VRTM_ERROR_BUSY".
inline const char *name(Code code) noexcept { return vrtm_status_string(value(code)); }

// The version of the library that is loaded, to compare with VRTM_VERSION.
inline std::uint32_t version() noexcept { return vrtm_version(); }

// ---- Results ----

template <class T = void> class Result;

// The outcome of a call. It stores its message without allocating.
template <> class [[nodiscard]] Result<void> {
public:
    Result() noexcept = default;

    // The outcome of this thread's last call.
    explicit Result(vrtm_status status) noexcept : code_(Code(status))
    {
        if (code_ != Code::ok) {
            const char *text = vrtm_last_error();
            const std::size_t length = std::strlen(text);
            std::memcpy(message_, text, length < sizeof message_ ? length : sizeof message_ - 1);
        }
    }

    explicit operator bool() const noexcept { return code_ == Code::ok; }
    Code code() const noexcept { return code_; }
    // The message of vrtm_last_error(); "" if the call succeeded.
    const char *message() const noexcept { return message_; }

#if VRTM_EXCEPTIONS
    // Throws vrtm::Error if the call failed.
    void value() const;
#endif

private:
    Code code_ = Code::ok;
    char message_[512] = {};
};

// The outcome of a call, and its value.
template <class T> class [[nodiscard]] Result : public Result<void> {
public:
    Result(T value, vrtm_status status) noexcept : Result<void>(status), value_(std::move(value)) {}
    Result(T value, const Result<void> &result) noexcept : Result<void>(result), value_(std::move(value)) {}

    // The call's value; empty or zero if it failed.
    T &operator*() & noexcept { return value_; }
    const T &operator*() const & noexcept { return value_; }
    T operator*() && noexcept { return std::move(value_); }
    T *operator->() noexcept { return &value_; }
    const T *operator->() const noexcept { return &value_; }

#if VRTM_EXCEPTIONS
    // The call's value. Throws vrtm::Error if it failed.
    T value() &&
    {
        Result<void>::value();
        return std::move(value_);
    }
    const T &value() const &
    {
        Result<void>::value();
        return value_;
    }
#endif

private:
    T value_;
};

#if VRTM_EXCEPTIONS
// The exception of a failed call.
class Error : public std::runtime_error {
public:
    explicit Error(const Result<void> &result) : std::runtime_error(result.message()), code_(result.code()) {}
    Code code() const noexcept { return code_; }

private:
    Code code_;
};

inline void Result<void>::value() const
{
    if (code_ != Code::ok) {
        throw Error(*this);
    }
}
#endif

// ---- Views of the caller's memory ----

// Vectors or single numbers, with a stride in bytes; 0 = tightly packed.
class Array {
public:
    Array(const float *data, std::size_t count, std::size_t stride = 0) noexcept
        : Array(Scalar::f32, data, count, stride)
    {
    }
    Array(const double *data, std::size_t count, std::size_t stride = 0) noexcept
        : Array(Scalar::f64, data, count, stride)
    {
    }
    Array(Scalar format, const void *data, std::size_t count, std::size_t stride = 0) noexcept
    {
        c_.format = vrtm::value(format);
        c_.data = data;
        c_.count = count;
        c_.stride = stride;
    }
    // Arrays such as Maya's `double (*points)[4]`, whose fourth coordinate is skipped.
    template <class S, std::size_t N>
    Array(const S (*vectors)[N], std::size_t count) noexcept
        : Array(reinterpret_cast<const S *>(vectors), count, sizeof *vectors)
    {
    }
    // The host's own vector type, which starts with components of type S: `Array::of<float>(points, count)`.
    template <class S, class V> static Array of(const V *vectors, std::size_t count) noexcept
    {
        static_assert(sizeof(V) >= sizeof(S), "a vector has at least one component");
        return Array(reinterpret_cast<const S *>(vectors), count, sizeof(V));
    }

    const vrtm_array &c() const noexcept { return c_; }

private:
    vrtm_array c_ = vrtm_array_init();
};

// A list of indices or counts, unsigned or, as in Maya, `int`. An empty list is not the same as no list.
class Indices {
public:
    Indices() noexcept = default;
    Indices(const std::uint32_t *data, std::size_t count) noexcept : count_(count)
    {
        // The C functions take null as "no list", and a vector without elements may have null.
        if (data != nullptr || count != 0) {
            data_ = data;
        }
    }
    // Signed and unsigned integers of one size may alias; a negative one is out of range for any index.
    Indices(const std::int32_t *data, std::size_t count) noexcept
        : Indices(reinterpret_cast<const std::uint32_t *>(data), count)
    {
    }
    // A std::vector, std::array, std::span and the like. It must outlive this object, so temporaries are rejected.
    template <class List, class = decltype(std::declval<const List &>().data())>
    Indices(const List &list) noexcept : Indices(list.data(), list.size())
    {
    }
    template <class List, class = decltype(std::declval<const List &>().data())> Indices(const List &&) = delete;

    const std::uint32_t *data() const noexcept { return data_; }
    std::size_t size() const noexcept { return count_; }

private:
    // A non-null address that is never read. (A static object would keep a plug-in in memory after its unload.)
    const std::uint32_t *data_ = reinterpret_cast<const std::uint32_t *>(alignof(std::uint32_t));
    std::size_t count_ = 0;
};

// What Image and ImageOut have in common.
namespace detail {
template <class Self, class Struct> class ImageBase {
public:
    Self &origin(Origin origin) noexcept
    {
        c_.origin = vrtm::value(origin);
        return self();
    }
    // Bytes from one texel to the next; 0 = tightly packed.
    Self &pixel_stride(std::size_t bytes) noexcept
    {
        c_.pixel_stride = bytes;
        return self();
    }
    // Bytes from one row to the next; 0 = tightly packed.
    Self &row_stride(std::size_t bytes) noexcept
    {
        c_.row_stride = bytes;
        return self();
    }

    const Struct &c() const noexcept { return c_; }

protected:
    ImageBase(Struct c, std::uint32_t width, std::uint32_t height, PixelFormat format) noexcept : c_(c)
    {
        c_.width = width;
        c_.height = height;
        c_.format = vrtm::value(format);
    }
    Struct c_;

private:
    Self &self() noexcept { return static_cast<Self &>(*this); }
};
} // namespace detail

// An input image with one channel. Since 16 bits may be integers or floats, they need the constructor with a format.
class Image : public detail::ImageBase<Image, vrtm_image> {
public:
    Image(const float *data, std::uint32_t width, std::uint32_t height) noexcept
        : Image(PixelFormat::f32, data, width, height)
    {
    }
    Image(const std::uint8_t *data, std::uint32_t width, std::uint32_t height) noexcept
        : Image(PixelFormat::u8, data, width, height)
    {
    }
    Image(PixelFormat format, const void *data, std::uint32_t width, std::uint32_t height) noexcept
        : ImageBase(vrtm_image_init(), width, height, format)
    {
        c_.data = data;
    }
};

// An output image: as many channels as its content has, two for UVs.
class ImageOut : public detail::ImageBase<ImageOut, vrtm_image_out> {
public:
    ImageOut(float *data, std::uint32_t width, std::uint32_t height) noexcept
        : ImageOut(PixelFormat::f32, data, width, height)
    {
    }
    ImageOut(PixelFormat format, void *data, std::uint32_t width, std::uint32_t height) noexcept
        : ImageBase(vrtm_image_out_init(), width, height, format)
    {
        c_.data = data;
    }
    // 3 adds a channel of 0 after u and v. 4, for a redirection, adds one that is 1 where a chart covers the texel and
    // 0 elsewhere.
    ImageOut &channels(std::uint32_t count) noexcept
    {
        c_.channels = count;
        return *this;
    }
};

// An output image in memory of the host's own Vulkan device: the fields of vrtm_external_image.
struct ExternalImage : vrtm_external_image {
    ExternalImage() noexcept : vrtm_external_image(vrtm_external_image_init()) {}

    // A file descriptor of the memory, which the caller still owns, and the size and type of its allocation.
    ExternalImage(int fd, std::uint64_t size_of_memory, std::uint32_t type_of_memory, std::uint32_t texels_in_u,
                  std::uint32_t texels_in_v) noexcept
        : ExternalImage()
    {
        handle_kind = VRTM_EXTERNAL_OPAQUE_FD;
        handle = static_cast<std::uint64_t>(fd);
        memory_size = size_of_memory;
        memory_type = type_of_memory;
        width = texels_in_u;
        height = texels_in_v;
    }

    ExternalImage &set(Origin wanted) noexcept
    {
        origin = vrtm::value(wanted);
        return *this;
    }
    // PixelFormat::f16 is for the delta, in half of the bytes.
    ExternalImage &set(PixelFormat wanted) noexcept
    {
        format = vrtm::value(wanted);
        return *this;
    }
};

// The kind, format and size of a redirection map for Tile::inspect_map().
class MapDesc {
public:
    MapDesc(std::uint32_t width, std::uint32_t height, FetchKind kind = FetchKind::redirection,
            PixelFormat format = PixelFormat::f32) noexcept
    {
        c_.width = width;
        c_.height = height;
        c_.kind = vrtm::value(kind);
        c_.format = vrtm::value(format);
    }
    const vrtm_map_desc &c() const noexcept { return c_; }

private:
    vrtm_map_desc c_ = vrtm_map_desc_init();
};

// ---- The host's threads ----

// One of the library's tasks: call it, once per index.
class Task {
public:
    Task(vrtm_task_fn task, void *data) noexcept : task_(task), data_(data) {}
    void operator()(std::size_t index = 0) const noexcept { task_(data_, index); }

private:
    vrtm_task_fn task_;
    void *data_;
};

// ---- Device ----

using Log = std::function<void(const vrtm_log_entry &entry)>;

// Settings of a new device: the fields of vrtm_device_desc, and the functions of the host.
struct DeviceDesc : vrtm_device_desc {
    DeviceDesc() noexcept : vrtm_device_desc(vrtm_device_desc_init()) {}

    DeviceDesc &set(Backend wanted) noexcept
    {
        backend = vrtm::value(wanted);
        return *this;
    }

    // Selects the GPU with this UUID (16 bytes) or LUID (8 bytes) instead of the number `adapter`: the GPU that the
    // host draws with.
    DeviceDesc &set_uuid(const void *uuid) noexcept { return set_id(VRTM_ADAPTER_BY_UUID, uuid, 16); }
    DeviceDesc &set_luid(const void *luid) noexcept { return set_id(VRTM_ADAPTER_BY_LUID, luid, 8); }
    // Selects the GPU with this MTLDevice.registryID.
    DeviceDesc &set_registry_id(std::uint64_t id) noexcept { return set_id(VRTM_ADAPTER_BY_REGISTRY_ID, &id, 8); }

    // The device, its assets and their jobs keep the function alive. Exceptions that it throws are ignored.
    DeviceDesc &set_log(Log function)
    {
        const std::shared_ptr<Log> kept(new Log(std::move(function)));
        keep_log = kept;
        log_user = kept.get();
        log = [](void *user, const vrtm_log_entry *entry) noexcept {
#if VRTM_EXCEPTIONS
            try {
                (*static_cast<const Log *>(user))(*entry);
            } catch (...) {
            }
#else
            (*static_cast<const Log *>(user))(*entry);
#endif
        };
        return *this;
    }

    // The host's threads: any object with `void parallel_for(std::size_t count, vrtm::Task task)` and, if it is to run
    // jobs, `void spawn(vrtm::Task task)`. They must not throw. The device, its assets and their jobs keep it alive.
    template <class Pool> DeviceDesc &set_executor(std::shared_ptr<Pool> pool)
    {
        struct Kept {
            vrtm_executor c;
            std::shared_ptr<Pool> pool;
        };
        const std::shared_ptr<Kept> kept(new Kept{vrtm_executor_init(), std::move(pool)});
        kept->c.user = kept->pool.get();
        kept->c.parallel_for = [](void *user, std::size_t count, vrtm_task_fn task, void *data) noexcept {
            static_cast<Pool *>(user)->parallel_for(count, Task(task, data));
        };
        kept->c.spawn = spawn_of<Pool>(0);
        executor = &kept->c;
        keep_executor = kept;
        return *this;
    }

    // The host's allocator: any object with `void *allocate(std::size_t size, std::size_t alignment)`, which returns
    // null if out of memory, and `void deallocate(void *pointer, std::size_t size, std::size_t alignment)`. They must
    // not throw. The device, its assets and their jobs keep it alive.
    template <class Memory> DeviceDesc &set_allocator(std::shared_ptr<Memory> memory)
    {
        struct Kept {
            vrtm_allocator c;
            std::shared_ptr<Memory> memory;
        };
        const std::shared_ptr<Kept> kept(new Kept{vrtm_allocator_init(), std::move(memory)});
        kept->c.user = kept->memory.get();
        kept->c.alloc = [](void *user, std::size_t size, std::size_t alignment) noexcept {
            return static_cast<Memory *>(user)->allocate(size, alignment);
        };
        kept->c.free = [](void *user, void *pointer, std::size_t size, std::size_t alignment) noexcept {
            static_cast<Memory *>(user)->deallocate(pointer, size, alignment);
        };
        allocator = &kept->c;
        keep_allocator = kept;
        return *this;
    }

    // Keeps the functions above alive.
    std::shared_ptr<const void> keep_log, keep_executor, keep_allocator;

private:
    DeviceDesc &set_id(vrtm_adapter_by by, const void *id, std::size_t size) noexcept
    {
        adapter_by = by;
        std::memset(adapter_id, 0, sizeof adapter_id);
        std::memcpy(adapter_id, id, size);
        return *this;
    }

    template <class Pool>
    static auto spawn_of(int) noexcept
        -> decltype(std::declval<Pool &>().spawn(std::declval<Task>()), vrtm_spawn_fn())
    {
        return [](void *user, vrtm_task_fn task, void *data) noexcept {
            static_cast<Pool *>(user)->spawn(Task(task, data));
        };
    }
    template <class Pool> static vrtm_spawn_fn spawn_of(...) noexcept { return nullptr; }
};

// The GPUs that a device can be made on; DeviceDesc::adapter is an index into this list, and DeviceDesc::set_uuid()
// takes the UUID of one.
inline Result<std::vector<vrtm_adapter_info>> adapters()
{
    std::uint32_t count = 0;
    Result<> result(vrtm_adapter_count(&count));
    std::vector<vrtm_adapter_info> adapters(count, vrtm_adapter_info_init());
    for (std::uint32_t i = 0; i < count && result; ++i) {
        result = Result<>(vrtm_adapter_get_info(i, &adapters[i]));
    }
    return {std::move(adapters), result};
}

namespace detail {

// The host's functions that an object needs: log, executor, allocator and, for a job, its progress function.
using Keep = std::array<std::shared_ptr<const void>, 4>;

// Overloads for Owner. (A function of a DLL cannot be a template's argument.)
inline void destroy(vrtm_device device) noexcept { static_cast<void>(vrtm_device_destroy(device)); }
inline void destroy(vrtm_asset asset) noexcept { static_cast<void>(vrtm_asset_destroy(asset)); }
inline void destroy(vrtm_job job) noexcept { static_cast<void>(vrtm_job_destroy(job)); }
inline void destroy(vrtm_refinement refinement) noexcept { static_cast<void>(vrtm_refinement_destroy(refinement)); }
inline void destroy(vrtm_carrier carrier) noexcept { static_cast<void>(vrtm_carrier_destroy(carrier)); }

// Owns a handle, which may be zero, and the host's functions that it needs until it is destroyed.
template <class Handle> class Owner {
public:
    Owner() noexcept = default;
    ~Owner() { reset(); }
    Owner(Owner &&other) noexcept : handle_(std::exchange(other.handle_, Handle{})), keep_(std::move(other.keep_)) {}
    Owner &operator=(Owner &&other) noexcept
    {
        if (this != &other) {
            reset();
            handle_ = std::exchange(other.handle_, Handle{});
            keep_ = std::move(other.keep_);
        }
        return *this;
    }

    explicit operator bool() const noexcept { return handle_.id != 0; }
    Handle handle() const noexcept { return handle_; }
    // Destroys the handle, unless it is empty. A job is cancelled, and waited for.
    void reset() noexcept
    {
        if (handle_.id != 0) {
            destroy(std::exchange(handle_, Handle{}));
        }
        keep_ = Keep();
    }

protected:
    Owner(Handle handle, Keep keep) noexcept : handle_(handle), keep_(std::move(keep)) {}
    const Keep &keep() const noexcept { return keep_; }

private:
    Handle handle_{};
    Keep keep_;
};

} // namespace detail

// Where assets are solved. Assets may outlive it.
class Device : public detail::Owner<vrtm_device> {
public:
    // Empty: no device.
    Device() noexcept = default;

    static Result<Device> create(const DeviceDesc &desc = DeviceDesc())
    {
        vrtm_device handle{};
        const vrtm_status status = vrtm_device_create(&desc, &handle);
        return {Device(handle, {desc.keep_log, desc.keep_executor, desc.keep_allocator, nullptr}), status};
    }

    Result<vrtm_device_info> info() const noexcept
    {
        vrtm_device_info data = vrtm_device_info_init();
        const vrtm_status status = vrtm_device_get_info(handle(), &data);
        return {data, status};
    }

private:
    friend class Asset;
    Device(vrtm_device handle, detail::Keep keep) noexcept : Owner(handle, std::move(keep)) {}
};

// ---- Mesh ----

// A further UV set of a mesh.
class UvSet {
public:
    explicit UvSet(const Array &uvs) noexcept : uvs_(uvs) {}
    UvSet(const Array &u, const Array &v) noexcept : u_(u), v_(v) {}
    UvSet &uv_indices(const Indices &indices) noexcept
    {
        indices_ = indices;
        return *this;
    }

    // Points into this object.
    vrtm_uv_set c() const & noexcept
    {
        vrtm_uv_set c{};
        c.uvs = uvs_ ? &uvs_->c() : nullptr;
        c.u = u_ ? &u_->c() : nullptr;
        c.v = v_ ? &v_->c() : nullptr;
        c.uv_indices = indices_ ? indices_->data() : nullptr;
        c.uv_index_count = indices_ ? indices_->size() : 0;
        return c;
    }
    vrtm_uv_set c() const && = delete;

private:
    std::optional<Array> uvs_, u_, v_;
    std::optional<Indices> indices_;
};

// A mesh at rest: a vrtm_mesh_desc that owns its arrays' descriptions. Optional parts that are not set are absent.
class Mesh {
public:
    Mesh(const Array &positions, const Indices &indices) noexcept : positions_(positions), indices_(indices) {}
    Mesh(const Mesh &other) { *this = other; }
    Mesh(Mesh &&) noexcept = default;
    Mesh &operator=(Mesh &&) noexcept = default;
    Mesh &operator=(const Mesh &other)
    {
        positions_ = other.positions_;
        indices_ = other.indices_;
        lists_ = other.lists_;
        base_ = other.base_;
        weld_ = other.weld_;
        weld_position_tolerance_ = other.weld_position_tolerance_;
        weld_uv_tolerance_ = other.weld_uv_tolerance_;
        max_layers_ = other.max_layers_;
        sets_ = other.sets_;
        link();
        return *this;
    }

    Mesh &uvs(const Array &pairs) noexcept { return set_base(UvSet(pairs)); }
    Mesh &uvs(const Array &u, const Array &v) noexcept { return set_base(UvSet(u, v)); }
    Mesh &uv_indices(const Indices &indices) noexcept { return set_list(uv_index, indices); }
    Mesh &face_counts(const Indices &counts) noexcept { return set_list(counts_of_faces, counts); }
    Mesh &face_offsets(const Indices &offsets) noexcept { return set_list(offsets_of_faces, offsets); }
    // Two vertices per seam.
    Mesh &seams(const Indices &pairs) noexcept { return set_list(seam_pairs, pairs); }
    Mesh &textured_faces(const Indices &faces) noexcept { return set_list(textured, faces); }
    Mesh &weld(Weld weld) noexcept
    {
        weld_ = weld;
        return *this;
    }
    Mesh &weld(Weld weld, double position_tolerance, double uv_tolerance) noexcept
    {
        weld_ = weld;
        weld_position_tolerance_ = position_tolerance;
        weld_uv_tolerance_ = uv_tolerance;
        return *this;
    }
    // From 2 on: charts that lie over one another get up to so many layers.
    Mesh &max_layers(std::uint64_t count) noexcept
    {
        max_layers_ = count;
        return *this;
    }
    Mesh &add_uv_set(const UvSet &set)
    {
        sets_.push_back(set);
        link();
        return *this;
    }

    // Points into this object.
    vrtm_mesh_desc c() const & noexcept
    {
        vrtm_mesh_desc c = vrtm_mesh_desc_init();
        c.positions = &positions_.c();
        c.indices = indices_.data();
        c.index_count = indices_.size();
        if (base_) {
            const vrtm_uv_set base = base_->c();
            c.uvs = base.uvs;
            c.u = base.u;
            c.v = base.v;
        }
        put(uv_index, c.uv_indices, c.uv_index_count);
        put(counts_of_faces, c.face_counts, c.face_count);
        put(offsets_of_faces, c.face_offsets, c.face_offset_count);
        put(seam_pairs, c.seams, c.seam_count);
        c.seam_count /= 2;
        put(textured, c.textured_faces, c.textured_face_count);
        c.uv_sets = c_sets_.empty() ? nullptr : c_sets_.data();
        c.uv_set_count = c_sets_.size();
        c.weld = vrtm::value(weld_);
        c.weld_position_tolerance = weld_position_tolerance_;
        c.weld_uv_tolerance = weld_uv_tolerance_;
        c.max_layers = max_layers_;
        return c;
    }
    vrtm_mesh_desc c() const && = delete;

private:
    enum List { uv_index, counts_of_faces, offsets_of_faces, seam_pairs, textured, lists };

    Mesh &set_base(const UvSet &set) noexcept
    {
        base_ = set;
        return *this;
    }
    Mesh &set_list(List list, const Indices &indices) noexcept
    {
        lists_[list] = indices;
        return *this;
    }
    void put(List list, const std::uint32_t *&data, std::size_t &count) const noexcept
    {
        if (lists_[list]) {
            data = lists_[list]->data();
            count = lists_[list]->size();
        }
    }
    void link()
    {
        c_sets_.clear();
        for (const UvSet &set : sets_) {
            c_sets_.push_back(set.c());
        }
    }

    Array positions_{static_cast<const float *>(nullptr), 0};
    Indices indices_;
    std::array<std::optional<Indices>, lists> lists_;
    std::optional<UvSet> base_;
    Weld weld_ = Weld::index;
    double weld_position_tolerance_ = vrtm_mesh_desc_init().weld_position_tolerance;
    double weld_uv_tolerance_ = vrtm_mesh_desc_init().weld_uv_tolerance;
    std::uint64_t max_layers_ = 0;
    std::vector<UvSet> sets_;
    std::vector<vrtm_uv_set> c_sets_; // points into sets_
};

// ---- Tile ----

// A tile's settings: the fields of vrtm_tile_settings, initially the defaults.
struct TileSettings : vrtm_tile_settings {
    TileSettings() noexcept : vrtm_tile_settings(vrtm_tile_settings_init()) {}
    TileSettings &set(Overlap wanted) noexcept
    {
        overlap = vrtm::value(wanted);
        return *this;
    }
    TileSettings &set(Seams wanted) noexcept
    {
        seams = vrtm::value(wanted);
        return *this;
    }
    TileSettings &set(OpenBorders wanted) noexcept
    {
        open_borders = vrtm::value(wanted);
        return *this;
    }
};

namespace detail {

inline vrtm_fetch fetch(vrtm_tile tile, FetchKind kind, const ImageOut &image, std::uint32_t uv_set) noexcept
{
    vrtm_fetch c = vrtm_fetch_init();
    c.tile = tile;
    c.kind = vrtm::value(kind);
    c.image = &image.c();
    c.uv_set = uv_set;
    return c;
}

} // namespace detail

// A tile of an asset: a plain handle that ends with the asset.
class Tile {
public:
    // Empty: no tile.
    Tile() noexcept = default;
    explicit Tile(vrtm_tile handle) noexcept : handle_(handle) {}

    explicit operator bool() const noexcept { return handle_.id != 0; }
    vrtm_tile handle() const noexcept { return handle_; }
    friend bool operator==(Tile a, Tile b) noexcept { return a.handle_.id == b.handle_.id; }
    friend bool operator!=(Tile a, Tile b) noexcept { return a.handle_.id != b.handle_.id; }

    // UDIM number, UV set and layer.
    Result<vrtm_tile_key> key() const noexcept
    {
        vrtm_tile_key key{};
        const vrtm_status status = vrtm_tile_get_key(handle_, &key);
        return {key, status};
    }
    Result<std::uint32_t> udim() const noexcept
    {
        const Result<vrtm_tile_key> found = key();
        return {found->udim, found};
    }
    Result<vrtm_tile_info> info() const noexcept
    {
        vrtm_tile_info data = vrtm_tile_info_init();
        const vrtm_status status = vrtm_tile_get_info(handle_, &data);
        return {data, status};
    }

    Result<> set_rigidity(const Image &map) const noexcept
    {
        return Result<>(vrtm_tile_set_rigidity(handle_, &map.c()));
    }
    // Removes the map.
    Result<> set_rigidity(std::nullptr_t) const noexcept
    {
        return Result<>(vrtm_tile_set_rigidity(handle_, nullptr));
    }
    Result<> update_rigidity(const Image &map, std::uint32_t x, std::uint32_t y, std::uint32_t width,
                                 std::uint32_t height) const noexcept
    {
        return Result<>(vrtm_tile_update_rigidity(handle_, &map.c(), x, y, width, height));
    }
    Result<> set_mask(const Image &mask) const noexcept { return Result<>(vrtm_tile_set_mask(handle_, &mask.c())); }
    // Removes the mask.
    Result<> set_mask(std::nullptr_t) const noexcept { return Result<>(vrtm_tile_set_mask(handle_, nullptr)); }

    Result<> set_settings(const TileSettings &settings) const noexcept
    {
        return Result<>(vrtm_tile_set_settings(handle_, &settings));
    }
    // Resets all settings to their defaults.
    Result<> set_settings(std::nullptr_t) const noexcept
    {
        return Result<>(vrtm_tile_set_settings(handle_, nullptr));
    }
    Result<TileSettings> settings() const noexcept
    {
        TileSettings settings;
        const vrtm_status status = vrtm_tile_get_settings(handle_, &settings);
        return {settings, status};
    }

    Result<> freeze(bool frozen) const noexcept { return Result<>(vrtm_tile_freeze(handle_, frozen ? 1 : 0)); }

    // Cells of the grid in u and v with the present rigidity and settings.
    Result<vrtm_tile_grid> grid() const noexcept
    {
        vrtm_tile_grid cells{};
        const vrtm_status status = vrtm_tile_get_grid(handle_, &cells);
        return {cells, status};
    }

    Result<vrtm_tile_estimate> estimate() const noexcept
    {
        vrtm_tile_estimate estimate = vrtm_tile_estimate_init();
        const vrtm_status status = vrtm_tile_get_estimate(handle_, &estimate);
        return {estimate, status};
    }

    // The prepared tile, for load().
    Result<std::vector<unsigned char>> save() const
    {
        std::size_t size = 0;
        vrtm_status status = vrtm_tile_save(handle_, nullptr, 0, &size);
        std::vector<unsigned char> data(size);
        if (status == VRTM_OK) {
            status = vrtm_tile_save(handle_, data.data(), data.size(), &size);
        }
        return {std::move(data), status};
    }
    // Saves into the caller's memory; returns the size. With null and 0 it only returns the size.
    Result<std::size_t> save(void *data, std::size_t capacity) const noexcept
    {
        std::size_t size = 0;
        const vrtm_status status = vrtm_tile_save(handle_, data, capacity, &size);
        return {size, status};
    }
    Result<> load(const void *data, std::size_t size) const noexcept
    {
        return Result<>(vrtm_tile_load(handle_, data, size));
    }
    Result<> load(const std::vector<unsigned char> &data) const noexcept
    {
        return load(data.data(), data.size());
    }

    // One output of the last solve; for FetchKind::uv_set and uv_set_delta UVs of the set `uv_set`.
    Result<> fetch(FetchKind kind, const ImageOut &image, std::uint32_t uv_set = 0) const noexcept
    {
        const vrtm_fetch c = detail::fetch(handle_, kind, image, uv_set);
        return Result<>(vrtm_asset_fetch(&c, 1));
    }
    // Of an image of `width` x `height` texels the rectangle of `image`'s size that begins at (x, y).
    Result<> fetch_part(FetchKind kind, const ImageOut &image, std::uint32_t x, std::uint32_t y,
                            std::uint32_t width, std::uint32_t height) const noexcept
    {
        vrtm_fetch c = detail::fetch(handle_, kind, image, 0);
        c.x = x;
        c.y = y;
        c.whole_width = width;
        c.whole_height = height;
        return Result<>(vrtm_asset_fetch(&c, 1));
    }

    // What a texture must hold around the tile's charts, up to `reach` in UV from their seams. Needs no solve.
    Result<> fetch_dilation(double reach, const ImageOut &image) const noexcept
    {
        return Result<>(vrtm_tile_fetch_dilation(handle_, reach, &image.c()));
    }

    // A redirection into memory of the host's own Vulkan device.
    Result<> fetch_external(FetchKind kind, const vrtm_external_image &image) const noexcept
    {
        return Result<>(vrtm_tile_fetch_external(handle_, vrtm::value(kind), &image));
    }

    // Inspects the map that a fetch would write, read with bilinear interpolation.
    Result<vrtm_map_info> inspect_map(const MapDesc &map) const noexcept
    {
        vrtm_map_info data = vrtm_map_info_init();
        const vrtm_status status = vrtm_tile_inspect_map(handle_, &map.c(), &data);
        return {data, status};
    }

    Result<vrtm_tile_report> report() const noexcept
    {
        vrtm_tile_report report = vrtm_tile_report_init();
        const vrtm_status status = vrtm_tile_get_report(handle_, &report);
        return {report, status};
    }

    // The painted features that are worse than without vrtm, the worst first, of a solve that measured.
    Result<std::vector<vrtm_worst_feature>> worst_features() const
    {
        std::uint32_t count = 0;
        vrtm_status status = vrtm_tile_get_worst_features(handle_, nullptr, 0, &count);
        std::vector<vrtm_worst_feature> features(count);
        if (status == VRTM_OK) {
            status = vrtm_tile_get_worst_features(handle_, features.data(), features.size(), &count);
            // Another thread may have solved since.
            features.resize(count < features.size() ? count : features.size());
        }
        return {std::move(features), status};
    }

private:
    vrtm_tile handle_{};
};

// ---- Solve ----

// Where to write vectors: the caller's memory.
class ArrayOut {
public:
    ArrayOut(float *data, std::size_t count, std::size_t stride = 0) noexcept
        : ArrayOut(Scalar::f32, data, count, stride)
    {
    }
    ArrayOut(double *data, std::size_t count, std::size_t stride = 0) noexcept
        : ArrayOut(Scalar::f64, data, count, stride)
    {
    }
    ArrayOut(Scalar format, void *data, std::size_t count, std::size_t stride = 0) noexcept
    {
        c_.format = vrtm::value(format);
        c_.data = data;
        c_.count = count;
        c_.stride = stride;
    }

    const vrtm_array_out &c() const & noexcept { return c_; }
    const vrtm_array_out &c() const && = delete; // It would be gone.

private:
    vrtm_array_out c_ = vrtm_array_out_init();
};

// Destinations of carried points: the fields of vrtm_carried.
struct Carried : vrtm_carried {
    Carried() noexcept : vrtm_carried(vrtm_carried_init()) {}
};

// An image of a tile, for Asset::redirect.
struct Fetch {
    Tile tile;
    ImageOut image;
    FetchKind kind = FetchKind::redirection;
    // For FetchKind::uv_set and uv_set_delta.
    std::uint32_t uv_set = 0;
};

// The outputs of Asset::redirect: it owns their descriptions, not the images' memory. Fill it once and use it for every
// frame.
class Fetches {
public:
    Fetches() noexcept = default;
    Fetches(std::initializer_list<Fetch> fetches)
    {
        for (const Fetch &fetch : fetches) {
            add(fetch);
        }
    }
    Fetches(const Fetches &other) : targets_(other.targets_), fetches_(other.fetches_) { link(); }
    Fetches(Fetches &&) noexcept = default;
    Fetches &operator=(Fetches &&) noexcept = default;
    Fetches &operator=(const Fetches &other) { return *this = Fetches(other); }

    Fetches &add(const Fetch &fetch)
    {
        fetches_.push_back(detail::fetch(fetch.tile.handle(), fetch.kind, fetch.image, fetch.uv_set));
        targets_.push_back({fetch.image.c(), vrtm_carried_init()});
        link();
        return *this;
    }
    // The points of a carrier. The arrays of `carried` must live as long as these fetches.
    Fetches &add(vrtm_carrier carrier, const Carried &carried)
    {
        vrtm_fetch fetch = vrtm_fetch_init();
        fetch.kind = VRTM_FETCH_CARRIED;
        fetch.carrier = carrier;
        fetches_.push_back(fetch);
        targets_.push_back({vrtm_image_out_init(), carried});
        link();
        return *this;
    }

    std::size_t size() const noexcept { return fetches_.size(); }
    const vrtm_fetch *c() const noexcept { return fetches_.data(); }

private:
    void link() noexcept
    {
        for (std::size_t i = 0; i < targets_.size(); ++i) {
            const bool is_carried = fetches_[i].kind == VRTM_FETCH_CARRIED;
            fetches_[i].image = is_carried ? nullptr : &targets_[i].image;
            fetches_[i].carried = is_carried ? &targets_[i].carried : nullptr;
        }
    }

    struct Target {
        vrtm_image_out image;
        vrtm_carried carried;
    };

    std::vector<Target> targets_;
    std::vector<vrtm_fetch> fetches_; // point into targets_
};

// The decision of a progress function.
enum class Proceed : bool { no, yes };

// A function that receives a solve's progress. If it throws, the solve is cancelled.
using Progress = std::function<Proceed(float progress)>;

// Options of one solve: the fields of vrtm_solve_options, initially the defaults, and the lists and the progress
// function.
struct SolveOptions : vrtm_solve_options {
    SolveOptions() noexcept : vrtm_solve_options(vrtm_solve_options_init()) {}

    SolveOptions &set(Quality wanted) noexcept
    {
        quality = vrtm::value(wanted);
        return *this;
    }
    SolveOptions &set(Solver wanted) noexcept
    {
        solver = vrtm::value(wanted);
        return *this;
    }
    // The tiles to solve, copied; an empty list means no tiles.
    SolveOptions &set_tiles(const std::vector<Tile> &wanted)
    {
        tiles_.emplace();
        for (const Tile tile : wanted) {
            tiles_->push_back(tile.handle());
        }
        return *this;
    }
    SolveOptions &set_all_tiles() noexcept
    {
        tiles_.reset();
        tiles = nullptr;
        return *this;
    }
    // The vertices that have moved, not copied; an empty list means no vertices.
    SolveOptions &set_dirty_vertices(const Indices &moved) noexcept
    {
        dirty_vertices = moved.data();
        dirty_vertex_count = moved.size();
        return *this;
    }
    SolveOptions &set_all_dirty() noexcept
    {
        dirty_vertices = nullptr;
        return *this;
    }
    SolveOptions &set_progress(Progress function)
    {
        progress_ = std::move(function);
        return *this;
    }

    // Points into this object.
    vrtm_solve_options c() const & noexcept { return c_with(&progress_); }
    vrtm_solve_options c() const && = delete;

private:
    friend class Asset;

    // The options with the given progress function, which may be a copy of this one's.
    vrtm_solve_options c_with(const Progress *function) const noexcept
    {
        vrtm_solve_options c = *this;
        if (tiles_) {
            // Not null, which would mean all.
            c.tiles = tiles_->empty() ? reinterpret_cast<const vrtm_tile *>(alignof(vrtm_tile)) : tiles_->data();
            c.tile_count = tiles_->size();
        }
        if (*function) {
            c.progress_user = const_cast<Progress *>(function);
            c.progress = [](void *user, float done) noexcept -> std::uint32_t {
#if VRTM_EXCEPTIONS
                try {
                    return (*static_cast<const Progress *>(user))(done) == Proceed::yes ? 0 : 1;
                } catch (...) {
                    return 1;
                }
#else
                return (*static_cast<const Progress *>(user))(done) == Proceed::yes ? 0 : 1;
#endif
            };
        }
        return c;
    }

    std::optional<std::vector<vrtm_tile>> tiles_;
    Progress progress_;
};

// ---- Jobs ----

// The state and progress of a job.
struct JobProgress {
    JobState state;
    Code code;
    float progress;
    std::chrono::duration<float, std::milli> time;
};

// One solve that runs beside the host's own work. The destructor cancels the job and waits for it.
class Job : public detail::Owner<vrtm_job> {
public:
    // Empty: no job.
    Job() noexcept = default;

    // Waits for the job; returns what Asset::solve would have returned.
    Result<> wait() const noexcept { return Result<>(vrtm_job_wait(handle(), VRTM_FOREVER)); }
    // Waits for a limited time; Code::timeout if the job is not done. 0 returns at once.
    template <class Rep, class Period>
    Result<> wait_for(const std::chrono::duration<Rep, Period> &time) const noexcept
    {
        return Result<>(vrtm_job_wait(handle(), whole_ms(std::chrono::duration<double, std::milli>(time).count())));
    }
    Result<JobProgress> progress() const noexcept
    {
        vrtm_job_progress c = vrtm_job_progress_init();
        const vrtm_status status = vrtm_job_get_progress(handle(), &c);
        const std::chrono::duration<float, std::milli> time(c.ms);
        return {JobProgress{JobState(c.state), Code(c.status), c.progress, time}, status};
    }
    Result<> cancel() const noexcept { return Result<>(vrtm_job_cancel(handle())); }

private:
    friend class Asset;
    Job(vrtm_job handle, detail::Keep keep) noexcept : Owner(handle, std::move(keep)) {}

    // Milliseconds are rounded up, and limited to 49 days.
    static std::uint32_t whole_ms(double ms) noexcept
    {
        if (!(ms > 0)) {
            return 0;
        }
        if (ms >= VRTM_FOREVER - 1) {
            return VRTM_FOREVER - 1;
        }
        const std::uint32_t whole = static_cast<std::uint32_t>(ms);
        return whole < ms ? whole + 1 : whole;
    }
};

// ---- Refinement ----

// How a mesh is refined. The fields are those of vrtm.h.
struct RefinementDesc : vrtm_refinement_desc {
    RefinementDesc() noexcept : vrtm_refinement_desc(vrtm_refinement_desc_init()) {}
};

// The pattern of a refinement, which owns its arrays.
struct RefinementPattern {
    std::vector<std::uint32_t> vertex_sources;
    std::vector<float> vertex_weights;
    std::vector<std::uint32_t> face_sources, face_corners, corner_vertices, corner_sources;
    std::vector<float> corner_weights, corner_uvs;
};

// An asset's mesh with its triangles split, for hosts that support only UV sets.
class Refinement : public detail::Owner<vrtm_refinement> {
public:
    // Empty: no refinement.
    Refinement() noexcept = default;

    // Refines further, for the asset's last result.
    Result<> extend() const noexcept { return Result<>(vrtm_refinement_extend(handle())); }
    Result<vrtm_refinement_info> info() const noexcept
    {
        vrtm_refinement_info data = vrtm_refinement_info_init();
        const vrtm_status status = vrtm_refinement_get_info(handle(), &data);
        return {data, status};
    }
    Result<RefinementPattern> pattern() const
    {
        const Result<vrtm_refinement_info> data = info();
        Result<> result = data;
        RefinementPattern p;
        if (result) {
            vrtm_refinement_pattern c = vrtm_refinement_pattern_init();
            c.vertex_count = static_cast<std::size_t>(data->vertices);
            c.face_count = static_cast<std::size_t>(data->faces);
            c.corner_count = static_cast<std::size_t>(data->corners);
            c.vertex_sources = sized(p.vertex_sources, 3 * c.vertex_count);
            c.vertex_weights = sized(p.vertex_weights, 3 * c.vertex_count);
            c.face_sources = sized(p.face_sources, c.face_count);
            c.face_corners = sized(p.face_corners, c.face_count);
            c.corner_vertices = sized(p.corner_vertices, c.corner_count);
            c.corner_sources = sized(p.corner_sources, 3 * c.corner_count);
            c.corner_weights = sized(p.corner_weights, 3 * c.corner_count);
            c.corner_uvs = sized(p.corner_uvs, 2 * c.corner_count);
            result = pattern(c);
        }
        return {std::move(p), result};
    }
    // Writes the pattern into the caller's arrays.
    Result<> pattern(const vrtm_refinement_pattern &pattern) const noexcept
    {
        return Result<>(vrtm_refinement_fetch_pattern(handle(), &pattern));
    }
    // UVs of the last result: one pair (u, v) per corner of the refined mesh.
    Result<std::vector<float>> corner_uvs() const
    {
        const Result<vrtm_refinement_info> data = info();
        std::vector<float> uvs(2 * static_cast<std::size_t>(data->corners));
        Result<> result = data;
        if (result) {
            result = corner_uvs(uvs.data(), uvs.size() / 2);
        }
        return {std::move(uvs), result};
    }
    // Writes the UVs into the caller's memory: `count` pairs, as many as the refinement has corners.
    Result<> corner_uvs(float *uvs, std::size_t count) const noexcept
    {
        return Result<>(vrtm_refinement_fetch_corner_uvs(handle(), uvs, count));
    }

private:
    friend class Asset;
    Refinement(vrtm_refinement handle, detail::Keep keep) noexcept : Owner(handle, std::move(keep)) {}

    template <class T> static T *sized(std::vector<T> &array, std::size_t count)
    {
        array.resize(count);
        return array.data();
    }
};

// ---- Carrier ----

// The points of a carrier. The fields are those of vrtm.h; the arrays that they point to must live until it is created.
struct CarrierDesc : vrtm_carrier_desc {
    CarrierDesc() noexcept : vrtm_carrier_desc(vrtm_carrier_desc_init()) {}

    CarrierDesc &set(Fit wanted) noexcept
    {
        fit = vrtm::value(wanted);
        return *this;
    }
    // UVs among all tiles.
    CarrierDesc &at_uvs(const Array &array) noexcept
    {
        bind = vrtm::value(Bind::uv);
        uvs = &array.c();
        return *this;
    }
    CarrierDesc &at_uvs(const Array &&) = delete; // It would be gone.
    // Three corners of one face and their weights for each point.
    CarrierDesc &at_corners(const Indices &indices, const Array &array) noexcept
    {
        bind = vrtm::value(Bind::corners);
        corners = indices.data();
        weights = &array.c();
        return *this;
    }
    CarrierDesc &at_corners(const Indices &, const Array &&) = delete;
    // The nearest points of the surface at rest, up to this distance; 0 = any.
    CarrierDesc &at_nearest(const Array &array, double distance = 0) noexcept
    {
        bind = vrtm::value(Bind::nearest);
        positions = &array.c();
        farthest = distance;
        return *this;
    }
    CarrierDesc &at_nearest(const Array &&, double = 0) = delete;
};

// Points bound to an asset's rest surface, which its solves move along.
class Carrier : public detail::Owner<vrtm_carrier> {
public:
    // Empty: no carrier.
    Carrier() noexcept = default;

    Result<vrtm_carrier_info> info() const noexcept
    {
        vrtm_carrier_info data = vrtm_carrier_info_init();
        const vrtm_status status = vrtm_carrier_get_info(handle(), &data);
        return {data, status};
    }
    // Carries the points into the pose of the last solve.
    Result<> fetch(const vrtm_carried &carried) const noexcept
    {
        return Result<>(vrtm_carrier_fetch(handle(), &carried));
    }
    // Positions alone.
    Result<> positions(const ArrayOut &out) const noexcept
    {
        Carried carried;
        carried.positions = &out.c();
        return fetch(carried);
    }
    // The binding of each point.
    Result<std::vector<PointState>> states() const
    {
        const Result<vrtm_carrier_info> data = info();
        std::vector<vrtm_point_state> states(static_cast<std::size_t>(data->points));
        Result<> result = data;
        if (result) {
            result = Result<>(vrtm_carrier_fetch_states(handle(), states.data(), states.size()));
        }
        std::vector<PointState> all;
        all.reserve(states.size());
        for (const vrtm_point_state state : states) {
            all.push_back(PointState(state));
        }
        return {std::move(all), result};
    }

private:
    friend class Asset;
    Carrier(vrtm_carrier handle, detail::Keep keep) noexcept : Owner(handle, std::move(keep)) {}
};

// ---- Asset ----

// One mesh with its tiles, their maps, settings and results.
class Asset : public detail::Owner<vrtm_asset> {
public:
    // Empty: no asset.
    Asset() noexcept = default;

    static Result<Asset> create(const Device &device, const Mesh &mesh) noexcept
    {
        return create(device, mesh.c());
    }
    static Result<Asset> create(const Device &device, const vrtm_mesh_desc &mesh) noexcept
    {
        vrtm_asset handle{};
        const vrtm_status status = vrtm_asset_create(device.handle(), &mesh, &handle);
        return {Asset(handle, device.keep()), status};
    }

    Result<vrtm_asset_info> info() const noexcept
    {
        vrtm_asset_info data = vrtm_asset_info_init();
        const vrtm_status status = vrtm_asset_get_info(handle(), &data);
        return {data, status};
    }

    Result<std::uint32_t> tile_count() const noexcept
    {
        const Result<vrtm_asset_info> of = info();
        return {of->tiles, of};
    }
    Result<Tile> tile(std::uint32_t index) const noexcept
    {
        vrtm_tile tile{};
        const vrtm_status status = vrtm_asset_get_tile(handle(), index, &tile);
        return {Tile(tile), status};
    }
    // All tiles: those of UV set 0 in the order of their UDIM numbers, then those of set 1, and so on. The layers of a
    // UDIM number follow one another.
    Result<std::vector<Tile>> tiles() const
    {
        const Result<std::uint32_t> count = tile_count();
        Result<> result = count;
        std::vector<Tile> tiles;
        for (std::uint32_t i = 0; i < *count && result; ++i) {
            const Result<Tile> next = tile(i);
            result = next;
            tiles.push_back(*next);
        }
        return {std::move(tiles), result};
    }
    Result<Tile> find_tile(std::uint32_t udim, std::uint32_t uv_set = 0, std::uint32_t layer = 0) const noexcept
    {
        const vrtm_tile_key key{udim, uv_set, layer, 0};
        vrtm_tile tile{};
        const vrtm_status status = vrtm_asset_find_tile(handle(), &key, &tile);
        return {Tile(tile), status};
    }
    // The layer of each face in a UV set.
    Result<std::vector<std::uint32_t>> face_layers(std::uint32_t uv_set = 0) const
    {
        const Result<vrtm_asset_info> data = info();
        std::vector<std::uint32_t> layers(static_cast<std::size_t>(data->faces));
        Result<> result = data;
        if (result) {
            result = Result<>(vrtm_asset_fetch_face_layers(handle(), uv_set, layers.data(), layers.size()));
        }
        return {std::move(layers), result};
    }

    Result<> set_vertex_rigidity(const Array &rigidity) const noexcept
    {
        return Result<>(vrtm_asset_set_vertex_rigidity(handle(), &rigidity.c()));
    }
    // Removes the values.
    Result<> set_vertex_rigidity(std::nullptr_t) const noexcept
    {
        return Result<>(vrtm_asset_set_vertex_rigidity(handle(), nullptr));
    }

    Result<> set_vertex_mask(const Array &mask) const noexcept
    {
        return Result<>(vrtm_asset_set_vertex_mask(handle(), &mask.c()));
    }
    // Removes the values.
    Result<> set_vertex_mask(std::nullptr_t) const noexcept
    {
        return Result<>(vrtm_asset_set_vertex_mask(handle(), nullptr));
    }

    Result<> solve(const Array &positions, const SolveOptions &options = SolveOptions()) const noexcept
    {
        const vrtm_solve_options c = options.c();
        return Result<>(vrtm_asset_solve(handle(), &positions.c(), &c));
    }
    Result<> redirect(const Array &positions, const Fetches &fetches,
                          const SolveOptions &options = SolveOptions()) const noexcept
    {
        const vrtm_solve_options c = options.c();
        return Result<>(vrtm_asset_redirect(handle(), &positions.c(), &c, fetches.c(), fetches.size()));
    }
    // Cancels the solve in progress, on another thread or of a job.
    Result<> cancel() const noexcept { return Result<>(vrtm_asset_cancel(handle())); }

    // The job keeps a copy of the progress function.
    Result<Job> submit(const Array &positions, const SolveOptions &options = SolveOptions()) const
    {
        const std::shared_ptr<const Progress> progress(new Progress(options.progress_));
        const vrtm_solve_options c = options.c_with(progress.get());
        vrtm_job handle_of_job{};
        const vrtm_status status = vrtm_asset_submit(handle(), &positions.c(), &c, &handle_of_job);
        detail::Keep kept = keep();
        kept[3] = progress;
        return {Job(handle_of_job, std::move(kept)), status};
    }

    // Redirected UVs: one pair (u, v) per face corner.
    Result<std::vector<float>> corner_uvs(std::uint32_t uv_set = 0) const
    {
        const Result<vrtm_asset_info> data = info();
        std::vector<float> uvs(2 * static_cast<std::size_t>(data->corners));
        Result<> result = data;
        if (result) {
            result = corner_uvs(uvs.data(), uvs.size() / 2, uv_set);
        }
        return {std::move(uvs), result};
    }
    // Writes the UVs into the caller's memory: `count` pairs, as many as the mesh has corners.
    Result<> corner_uvs(float *uvs, std::size_t count, std::uint32_t uv_set = 0) const noexcept
    {
        return Result<>(vrtm_asset_fetch_corner_uvs(handle(), uv_set, uvs, count));
    }

    // Refines the mesh for the last result.
    Result<Refinement> refine(const RefinementDesc &desc = RefinementDesc()) const noexcept
    {
        vrtm_refinement handle_of_refinement{};
        const vrtm_status status = vrtm_refinement_create(handle(), &desc, &handle_of_refinement);
        return {Refinement(handle_of_refinement, keep()), status};
    }

    // Binds points to the rest surface; they follow the solves that come after.
    Result<Carrier> carrier(const vrtm_carrier_desc &desc) const noexcept
    {
        vrtm_carrier handle_of_carrier{};
        const vrtm_status status = vrtm_carrier_create(handle(), &desc, &handle_of_carrier);
        return {Carrier(handle_of_carrier, keep()), status};
    }

    Result<vrtm_asset_report> report() const noexcept
    {
        vrtm_asset_report report = vrtm_asset_report_init();
        const vrtm_status status = vrtm_asset_get_report(handle(), &report);
        return {report, status};
    }

private:
    Asset(vrtm_asset handle, detail::Keep keep) noexcept : Owner(handle, std::move(keep)) {}
};

} // namespace vrtm

#endif // VRTM_HPP
