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
#include <cstdio>
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
enum class Scale : vrtm_scale { keep = VRTM_SCALE_KEEP, follow = VRTM_SCALE_FOLLOW };
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

namespace detail {
// Sets a field, and returns the object that it belongs to.
template <class Self, class Field, class Value> Self &set(Self &self, Field &field, const Value &wanted) noexcept
{
    field = static_cast<Field>(wanted);
    return self;
}
} // namespace detail

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
    explicit Result(vrtm_status status) noexcept
        : Result(Code(status), status == VRTM_OK ? "" : vrtm_last_error())
    {
    }
    // A failure of the caller's own.
    Result(Code code, const char *message) noexcept : code_(code)
    {
        const std::size_t length = std::strlen(message);
        std::memcpy(message_, message, length < sizeof message_ ? length : sizeof message_ - 1);
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

namespace detail {

// Reads what a function of C says of a handle. `value` has the struct's size.
template <class Handle, class Struct, class T>
Result<T> get(vrtm_status (*function)(Handle, Struct *), Handle handle, T value) noexcept
{
    const vrtm_status status = function(handle, &value);
    return {value, status};
}

// A list of `length` values, which `fill` writes if what tells the length is good.
template <class T, class Fill>
Result<std::vector<T>> list(const Result<> &told, std::uint64_t length, const Fill &fill)
{
    std::vector<T> values(static_cast<std::size_t>(length));
    const Result<> result = told ? Result<>(fill(values)) : told;
    return {std::move(values), result};
}

} // namespace detail

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

// Values of an image of this kind per texel: 2, the UV, but for the Jacobian and the filter scale. More are for those
// who want them: see ImageOut.
constexpr std::uint32_t channels(FetchKind kind) noexcept
{
    return kind == FetchKind::carried         ? 0
           : kind == FetchKind::jacobian      ? 4
           : kind == FetchKind::filter_scale  ? 1
                                              : 2;
}

// Values of a whole image of this kind: the length of its list. An image of carried points has none.
constexpr std::size_t image_size(FetchKind kind, std::uint32_t width, std::uint32_t height) noexcept
{
    return std::size_t(channels(kind)) * width * height;
}

namespace detail {

template <class S> constexpr Scalar scalar() noexcept
{
    static_assert(std::is_same<S, float>::value || std::is_same<S, double>::value, "components are float or double");
    return std::is_same<S, float>::value ? Scalar::f32 : Scalar::f64;
}

inline void set_default(vrtm_array &c) noexcept { c = vrtm_array_init(); }
inline void set_default(vrtm_array_out &c) noexcept { c = vrtm_array_out_init(); }

// Array and ArrayOut. They always state the stride, so that the library refuses elements that are too short.
template <class Struct, class Void> class ArrayView {
public:
    // A list of numbers, N of them for each element: `Array::of<3>(xyz)`. It is a std::vector, std::array, std::span,
    // an array of C or the like, which must outlive this object: temporaries are rejected. A list that ends within an
    // element is refused by the call that gets it, as one whose stride is too short.
    template <std::size_t N, class List> static ArrayView of(List &list) noexcept
    {
        const std::size_t size = std::size(list);
        return {std::data(list), size / N, size % N == 0 ? N * sizeof *std::data(list) : 1};
    }
    // A list of the host's own vector type, which starts with components of type S: `Array::of<float>(points)`.
    template <class S, class List> static ArrayView of(List &list) noexcept
    {
        return of<S>(std::data(list), std::size(list));
    }

    // The same by a pointer and the number of vectors.
    template <class S, class V> static ArrayView of(V *vectors, std::size_t count) noexcept
    {
        static_assert(sizeof(V) >= sizeof(S), "a vector has at least one component");
        return {scalar<S>(), vectors, count, sizeof(V)};
    }
    // `count` single numbers. Vectors need a stride, or of<3>().
    template <class S>
    ArrayView(S *numbers, std::size_t count) noexcept : ArrayView(numbers, count, sizeof(S))
    {
    }
    // `count` arrays, such as Maya's `double (*points)[4]`, whose fourth coordinate is skipped.
    template <class S, std::size_t N>
    ArrayView(S (*vectors)[N], std::size_t count) noexcept
        : ArrayView(reinterpret_cast<S *>(vectors), count, sizeof *vectors)
    {
    }
    // `count` elements (not numbers), with `stride` bytes from one to the next.
    template <class S>
    ArrayView(S *data, std::size_t count, std::size_t stride) noexcept
        : ArrayView(scalar<std::remove_const_t<S>>(), data, count, stride)
    {
    }
    ArrayView(Scalar format, Void *data, std::size_t count, std::size_t stride) noexcept
    {
        set_default(c_);
        c_.format = vrtm::value(format);
        c_.data = data;
        c_.count = count;
        c_.stride = stride;
    }

    const Struct &c() const & noexcept { return c_; }
    const Struct &c() const && = delete; // It would be gone.

private:
    Struct c_;
};

} // namespace detail

// Vectors or single numbers to read.
using Array = detail::ArrayView<vrtm_array, const void>;

// Where to write vectors. The comment of each output says how many components its elements have.
using ArrayOut = detail::ArrayView<vrtm_array_out, void>;

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

namespace detail {

// The format of a list's texels, where its type says it: 16 bits may be integers or floats.
template <class List> constexpr PixelFormat texel() noexcept
{
    using T = std::remove_cv_t<std::remove_pointer_t<decltype(std::data(std::declval<List &>()))>>;
    static_assert(std::is_same<T, float>::value || std::is_same<T, std::uint8_t>::value, "name the PixelFormat");
    return std::is_same<T, float>::value ? PixelFormat::f32 : PixelFormat::u8;
}

// What Image and ImageOut have in common.
template <class Self, class Struct> class ImageBase {
public:
    Self &origin(Origin origin) noexcept { return detail::set(self(), c_.origin, origin); }
    // Bytes from one texel to the next; 0 = tightly packed.
    Self &pixel_stride(std::size_t bytes) noexcept { return detail::set(self(), c_.pixel_stride, bytes); }
    // Bytes from one row to the next; 0 = tightly packed.
    Self &row_stride(std::size_t bytes) noexcept { return detail::set(self(), c_.row_stride, bytes); }

    const Struct &c() const noexcept { return c_; }
    // Good, unless a list has another length than the image that it was given for: then it names `argument`.
    Result<> fits(const char *argument) const noexcept
    {
        if (channels_ != 0) {
            return Result<>();
        }
        char text[200];
        std::snprintf(text, sizeof text, "%s: a list of %llu values is no image of %lu x %lu texels with %s", argument,
                      values_, static_cast<unsigned long>(c_.width), static_cast<unsigned long>(c_.height),
                      std::is_same<Struct, vrtm_image>::value ? "1 channel" : "1 to 4 channels");
        return Result<>(Code::invalid_argument, text);
    }

protected:
    template <class Data>
    ImageBase(Struct c, PixelFormat format, Data *data, std::uint32_t width, std::uint32_t height) noexcept : c_(c)
    {
        c_.width = width;
        c_.height = height;
        c_.format = vrtm::value(format);
        c_.data = data;
    }
    // Sets the channels to what a list has for each texel; 0 if it is too long or too short for `most`.
    template <class List> void set_list(const List &list, unsigned most) noexcept
    {
        constexpr std::size_t bytes[] = {4, 2, 2, 1}; // Of each PixelFormat.
        const std::uint64_t texels = std::uint64_t(c_.width) * c_.height;
        values_ = std::size(list) * sizeof *std::data(list) / bytes[c_.format];
        channels_ = values_ <= most * texels && texels != 0 && values_ % texels == 0 ? unsigned(values_ / texels) : 0;
    }
    Struct c_;
    std::uint32_t channels_ = 1;

private:
    Self &self() noexcept { return static_cast<Self &>(*this); }
    unsigned long long values_ = 0;
};

} // namespace detail

// An input image with one channel.
class Image : public detail::ImageBase<Image, vrtm_image> {
public:
    // A list with one value for each texel: a std::vector, std::array, std::span, an array of C or the like.
    template <class List, class = decltype(std::size(std::declval<List &>()))>
    Image(List &texels, std::uint32_t width, std::uint32_t height) noexcept
        : Image(detail::texel<List>(), texels, width, height)
    {
    }
    template <class List, class = decltype(std::size(std::declval<List &>()))>
    Image(PixelFormat format, List &texels, std::uint32_t width, std::uint32_t height) noexcept
        : ImageBase(vrtm_image_init(), format, std::data(texels), width, height)
    {
        set_list(texels, 1);
    }

    // The first of width * height texels. For one channel of several, set pixel_stride().
    Image(const float *data, std::uint32_t width, std::uint32_t height) noexcept
        : Image(PixelFormat::f32, data, width, height)
    {
    }
    Image(const std::uint8_t *data, std::uint32_t width, std::uint32_t height) noexcept
        : Image(PixelFormat::u8, data, width, height)
    {
    }
    Image(PixelFormat format, const void *data, std::uint32_t width, std::uint32_t height) noexcept
        : ImageBase(vrtm_image_init(), format, data, width, height)
    {
    }
};

// An output image of 1 to 4 channels, which have to be those of its content: channels(kind), two for UVs. A third
// channel after u and v is 0; a fourth, for a redirection, is 1 where a chart covers the texel and 0 elsewhere.
class ImageOut : public detail::ImageBase<ImageOut, vrtm_image_out> {
public:
    // A list with as many values for each texel as the image has channels: image_size(kind, width, height) in all.
    template <class List, class = decltype(std::size(std::declval<List &>()))>
    ImageOut(List &texels, std::uint32_t width, std::uint32_t height) noexcept
        : ImageOut(detail::texel<List>(), texels, width, height)
    {
    }
    template <class List, class = decltype(std::size(std::declval<List &>()))>
    ImageOut(PixelFormat format, List &texels, std::uint32_t width, std::uint32_t height) noexcept
        : ImageOut(format, std::data(texels), width, height, 0)
    {
        set_list(texels, 4);
        c_.channels = channels_;
    }

    // The first of width * height texels of so many channels; 0 = as many as the content has, which the caller knows.
    ImageOut(float *data, std::uint32_t width, std::uint32_t height, std::uint32_t channels) noexcept
        : ImageOut(PixelFormat::f32, data, width, height, channels)
    {
    }
    ImageOut(PixelFormat format, void *data, std::uint32_t width, std::uint32_t height, std::uint32_t channels) noexcept
        : ImageBase(vrtm_image_out_init(), format, data, width, height)
    {
        c_.channels = channels;
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

    ExternalImage &set(Origin wanted) noexcept { return detail::set(*this, origin, wanted); }
    // PixelFormat::f16 is for the delta, in half of the bytes.
    ExternalImage &set(PixelFormat wanted) noexcept { return detail::set(*this, format, wanted); }
};

// The kind, format and size of a redirection map for Tile::inspect_map().
struct MapDesc : vrtm_map_desc {
    MapDesc(std::uint32_t texels_in_u, std::uint32_t texels_in_v, FetchKind content = FetchKind::redirection,
            PixelFormat texel = PixelFormat::f32) noexcept
        : vrtm_map_desc(vrtm_map_desc_init())
    {
        width = texels_in_u;
        height = texels_in_v;
        kind = vrtm::value(content);
        format = vrtm::value(texel);
    }
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

namespace detail {
// Calls a function of the host's, whose exceptions end here.
template <class Call> void caught(const Call &call) noexcept
{
#if VRTM_EXCEPTIONS
    try {
        call();
    } catch (...) {
    }
#else
    call();
#endif
}
} // namespace detail

// ---- Device ----

using Log = std::function<void(const vrtm_log_entry &entry)>;

// Settings of a new device: the fields of vrtm_device_desc, and the functions of the host.
struct DeviceDesc : vrtm_device_desc {
    DeviceDesc() noexcept : vrtm_device_desc(vrtm_device_desc_init()) {}

    DeviceDesc &set(Backend wanted) noexcept { return detail::set(*this, backend, wanted); }

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
            detail::caught([=] { (*static_cast<const Log *>(user))(*entry); });
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
        return detail::get(vrtm_device_get_info, handle(), vrtm_device_info_init());
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
    UvSet &uv_indices(const Indices &indices) noexcept { return detail::set(*this, indices_, indices); }

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
        numbers_ = other.numbers_;
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
    Mesh &weld(Weld weld) noexcept { return detail::set(*this, numbers_.weld, weld); }
    Mesh &weld(Weld weld, double position_tolerance, double uv_tolerance) noexcept
    {
        numbers_.weld_position_tolerance = position_tolerance;
        numbers_.weld_uv_tolerance = uv_tolerance;
        return this->weld(weld);
    }
    // From 2 on: charts that lie over one another get up to so many layers.
    Mesh &max_layers(std::uint64_t count) noexcept { return detail::set(*this, numbers_.max_layers, count); }
    Mesh &add_uv_set(const UvSet &set)
    {
        sets_.push_back(set);
        link();
        return *this;
    }

    // Good, unless the last seam lacks a vertex.
    Result<> fits() const noexcept
    {
        const bool whole = !lists_[seam_pairs] || lists_[seam_pairs]->size() % 2 == 0;
        return whole ? Result<>() : Result<>(Code::invalid_argument, "mesh.seams: an odd number of vertices");
    }
    // Points into this object.
    vrtm_mesh_desc c() const & noexcept
    {
        vrtm_mesh_desc c = numbers_;
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
        return c;
    }
    vrtm_mesh_desc c() const && = delete;

private:
    enum List { uv_index, counts_of_faces, offsets_of_faces, seam_pairs, textured, lists };

    Mesh &set_base(const UvSet &set) noexcept { return detail::set(*this, base_, set); }
    Mesh &set_list(List list, const Indices &indices) noexcept { return detail::set(*this, lists_[list], indices); }
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
    vrtm_mesh_desc numbers_ = vrtm_mesh_desc_init(); // welding and layers; the rest is set by c()
    std::vector<UvSet> sets_;
    std::vector<vrtm_uv_set> c_sets_; // points into sets_
};

// ---- Tile ----

// A tile's settings: the fields of vrtm_tile_settings, initially the defaults.
struct TileSettings : vrtm_tile_settings {
    TileSettings() noexcept : vrtm_tile_settings(vrtm_tile_settings_init()) {}
    TileSettings &set(Overlap wanted) noexcept { return detail::set(*this, overlap, wanted); }
    TileSettings &set(Seams wanted) noexcept { return detail::set(*this, seams, wanted); }
    TileSettings &set(OpenBorders wanted) noexcept { return detail::set(*this, open_borders, wanted); }
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
        return detail::get(vrtm_tile_get_key, handle_, vrtm_tile_key{});
    }
    Result<std::uint32_t> udim() const noexcept
    {
        const Result<vrtm_tile_key> found = key();
        return {found->udim, found};
    }
    Result<vrtm_tile_info> info() const noexcept
    {
        return detail::get(vrtm_tile_get_info, handle_, vrtm_tile_info_init());
    }

    Result<> set_rigidity(const Image &map) const noexcept
    {
        const Result<> fits = map.fits("rigidity");
        return fits ? Result<>(vrtm_tile_set_rigidity(handle_, &map.c())) : fits;
    }
    // Removes the map.
    Result<> set_rigidity(std::nullptr_t) const noexcept
    {
        return Result<>(vrtm_tile_set_rigidity(handle_, nullptr));
    }
    Result<> update_rigidity(const Image &map, std::uint32_t x, std::uint32_t y, std::uint32_t width,
                                 std::uint32_t height) const noexcept
    {
        const Result<> fits = map.fits("rigidity");
        return fits ? Result<>(vrtm_tile_update_rigidity(handle_, &map.c(), x, y, width, height)) : fits;
    }
    Result<> set_mask(const Image &mask) const noexcept
    {
        const Result<> fits = mask.fits("mask");
        return fits ? Result<>(vrtm_tile_set_mask(handle_, &mask.c())) : fits;
    }
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
        return detail::get(vrtm_tile_get_settings, handle_, TileSettings());
    }

    Result<> freeze(bool frozen) const noexcept { return Result<>(vrtm_tile_freeze(handle_, frozen ? 1 : 0)); }

    // Cells of the grid in u and v with the present rigidity and settings.
    Result<vrtm_tile_grid> grid() const noexcept
    {
        return detail::get(vrtm_tile_get_grid, handle_, vrtm_tile_grid{});
    }

    Result<vrtm_tile_estimate> estimate() const noexcept
    {
        return detail::get(vrtm_tile_get_estimate, handle_, vrtm_tile_estimate_init());
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

    // One output of the last solve, of any size, with channels(kind) values per texel; for FetchKind::uv_set and
    // uv_set_delta UVs of the set `uv_set`.
    Result<> fetch(FetchKind kind, const ImageOut &image, std::uint32_t uv_set = 0) const noexcept
    {
        const vrtm_fetch c = detail::fetch(handle_, kind, image, uv_set);
        const Result<> fits = image.fits("image");
        return fits ? Result<>(vrtm_asset_fetch(&c, 1)) : fits;
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
        const Result<> fits = image.fits("image");
        return fits ? Result<>(vrtm_asset_fetch(&c, 1)) : fits;
    }

    // What a texture must hold around the tile's charts, up to `reach` in UV from their seams: an image of 2 to 4
    // channels. Needs no solve.
    Result<> fetch_dilation(double reach, const ImageOut &image) const noexcept
    {
        const Result<> fits = image.fits("image");
        return fits ? Result<>(vrtm_tile_fetch_dilation(handle_, reach, &image.c())) : fits;
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
        const vrtm_status status = vrtm_tile_inspect_map(handle_, &map, &data);
        return {data, status};
    }

    Result<vrtm_tile_report> report() const noexcept
    {
        return detail::get(vrtm_tile_get_report, handle_, vrtm_tile_report_init());
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

// Destinations of carried points: the fields of vrtm_carried. Each array has one element for each of the points:
// positions of 3 components, rotations of 4, matrices of 9, stretch and uvs of 2.
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
    Fetches(const Fetches &other) : fits_(other.fits_), targets_(other.targets_), fetches_(other.fetches_) { link(); }
    Fetches(Fetches &&) noexcept = default;
    Fetches &operator=(Fetches &&) noexcept = default;
    Fetches &operator=(const Fetches &other) { return *this = Fetches(other); }

    Fetches &add(const Fetch &fetch)
    {
        if (fits_) {
            char image[48];
            std::snprintf(image, sizeof image, "fetches[%lu].image", static_cast<unsigned long>(size()));
            fits_ = fetch.image.fits(image);
        }
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
    // Good, unless an image is not as long as its list: the first that is not.
    const Result<> &fits() const noexcept { return fits_; }

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

    Result<> fits_;
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

    SolveOptions &set(Quality wanted) noexcept { return detail::set(*this, quality, wanted); }
    SolveOptions &set(Scale wanted) noexcept { return detail::set(*this, scale, wanted); }
    SolveOptions &set(Solver wanted) noexcept { return detail::set(*this, solver, wanted); }
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
    SolveOptions &set_all_dirty() noexcept { return detail::set(*this, dirty_vertices, nullptr); }
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
                Proceed proceed = Proceed::no;
                detail::caught([&] { proceed = (*static_cast<const Progress *>(user))(done); });
                return proceed == Proceed::yes ? 0 : 1;
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
        return detail::get(vrtm_refinement_get_info, handle(), vrtm_refinement_info_init());
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
    // Writes the pattern into the caller's arrays, whose lengths are those of pattern() above.
    Result<> pattern(const vrtm_refinement_pattern &pattern) const noexcept
    {
        return Result<>(vrtm_refinement_fetch_pattern(handle(), &pattern));
    }
    // UVs of the last result: one pair (u, v) per corner of the refined mesh, 2 * info()->corners numbers.
    Result<std::vector<float>> corner_uvs() const
    {
        const Result<vrtm_refinement_info> data = info();
        return detail::list<float>(data, 2 * data->corners, [&](auto &uvs) { return corner_uvs(uvs); });
    }
    // Writes the UVs into a list of floats, 2 for each of info()->corners.
    template <class List> Result<> corner_uvs(List &uvs) const noexcept
    {
        float *const data = std::data(uvs);
        return corner_uvs(reinterpret_cast<float(*)[2]>(data), std::size(uvs) / 2);
    }
    Result<> corner_uvs(float (*uvs)[2], std::size_t count) const noexcept
    {
        return Result<>(vrtm_refinement_fetch_corner_uvs(handle(), reinterpret_cast<float *>(uvs), count));
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

    CarrierDesc &set(Fit wanted) noexcept { return detail::set(*this, fit, wanted); }
    // UVs among all tiles.
    CarrierDesc &at_uvs(const Array &array) noexcept
    {
        bind = vrtm::value(Bind::uv);
        uvs = &array.c();
        return *this;
    }
    CarrierDesc &at_uvs(const Array &&) = delete; // It would be gone.
    // Three corners of one face and their weights for each point. Another number of corners is refused, as no corners.
    CarrierDesc &at_corners(const Indices &indices, const Array &array) noexcept
    {
        bind = vrtm::value(Bind::corners);
        corners = indices.size() == 3 * array.c().count ? indices.data() : nullptr;
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
        return detail::get(vrtm_carrier_get_info, handle(), vrtm_carrier_info_init());
    }
    // Carries the points into the pose of the last solve: info()->points elements in each array.
    Result<> fetch(const vrtm_carried &carried) const noexcept
    {
        return Result<>(vrtm_carrier_fetch(handle(), &carried));
    }
    // Positions alone: info()->points elements of 3 components.
    Result<> positions(const ArrayOut &out) const noexcept
    {
        Carried carried;
        carried.positions = &out.c();
        return fetch(carried);
    }
    // The binding of each of info()->points.
    Result<std::vector<PointState>> states() const
    {
        const Result<vrtm_carrier_info> data = info();
        return detail::list<PointState>(data, data->points, [&](auto &states) {
            std::vector<vrtm_point_state> c(states.size());
            const vrtm_status status = vrtm_carrier_fetch_states(handle(), c.data(), c.size());
            for (std::size_t i = 0; i < c.size(); ++i) {
                states[i] = PointState(c[i]);
            }
            return status;
        });
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
        const Result<> fits = mesh.fits();
        return fits ? create(device, mesh.c()) : Result<Asset>(Asset(), fits);
    }
    static Result<Asset> create(const Device &device, const vrtm_mesh_desc &mesh) noexcept
    {
        vrtm_asset handle{};
        const vrtm_status status = vrtm_asset_create(device.handle(), &mesh, &handle);
        return {Asset(handle, device.keep()), status};
    }

    Result<vrtm_asset_info> info() const noexcept
    {
        return detail::get(vrtm_asset_get_info, handle(), vrtm_asset_info_init());
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
        return detail::list<std::uint32_t>(data, data->faces, [&](auto &layers) {
            return vrtm_asset_fetch_face_layers(handle(), uv_set, layers.data(), layers.size());
        });
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
        const Result<> &fits = fetches.fits();
        return fits ? Result<>(vrtm_asset_redirect(handle(), &positions.c(), &c, fetches.c(), fetches.size())) : fits;
    }
    // Cancels the solve in progress, on another thread or of a job.
    Result<> cancel() const noexcept { return Result<>(vrtm_asset_cancel(handle())); }

    // The job keeps a copy of the progress function. With options.replace = 1 the newest pose wins.
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

    // Redirected UVs: one pair (u, v) per face corner, 2 * info()->corners numbers.
    Result<std::vector<float>> corner_uvs(std::uint32_t uv_set = 0) const
    {
        const Result<vrtm_asset_info> data = info();
        return detail::list<float>(data, 2 * data->corners, [&](auto &uvs) { return corner_uvs(uvs, uv_set); });
    }
    // Writes the UVs into a list of floats, 2 for each of info()->corners.
    template <class List, class = decltype(std::size(std::declval<List &>()))>
    Result<> corner_uvs(List &uvs, std::uint32_t uv_set = 0) const noexcept
    {
        float *const data = std::data(uvs);
        return corner_uvs(reinterpret_cast<float(*)[2]>(data), std::size(uvs) / 2, uv_set);
    }
    Result<> corner_uvs(float (*uvs)[2], std::size_t count, std::uint32_t uv_set = 0) const noexcept
    {
        return Result<>(vrtm_asset_fetch_corner_uvs(handle(), uv_set, reinterpret_cast<float *>(uvs), count));
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
        return detail::get(vrtm_asset_get_report, handle(), vrtm_asset_report_init());
    }

private:
    Asset(vrtm_asset handle, detail::Keep keep) noexcept : Owner(handle, std::move(keep)) {}
};

} // namespace vrtm

#endif // VRTM_HPP
