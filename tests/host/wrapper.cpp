/*
 * vrtm.hpp as a host uses it that is built without exceptions: each class and each function that returns a Result. The
 * test builds it with exceptions, too, and as C++20.
 */

#include "platform.h"

#include "check.h"

#include <array>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>
#if defined(__cpp_exceptions)
#include <stdexcept>
#endif

#include "hostile_macros.h"
#include "vrtm.hpp"
#undef small

#if !defined(__cpp_exceptions) && VRTM_EXCEPTIONS
#error "the throwing forms are declared without exceptions"
#endif

namespace {

sheet s;
double pose[VERTICES][4], other[VERTICES][4];
/* The same positions to the bit: they are rounded to f32. */
float pose_f32[VERTICES][3];

using Map = std::vector<float>;

bool same(const Map &a, const Map &b)
{
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

/* Expects success. */
bool works(const char *what, const vrtm::Result<> &result)
{
    return check_that(bool(result) && result.code() == vrtm::Code::ok && result.message()[0] == 0, what,
                      result.message()) != 0;
}

/* Expects this error, and that its message contains `text`. */
void refuses(const char *what, const vrtm::Result<> &result, vrtm::Code code, const char *text)
{
    check_that(!result && result.code() == code && std::strstr(result.message(), text) != nullptr, what,
               result.message());
}

/* Faces of four corners, given as Maya has them: as `int`. */
std::array<int, FACES> counts;
std::array<int, CORNERS> corners;

vrtm::Mesh quads()
{
    vrtm::Mesh mesh(vrtm::Array(s.points, VERTICES), corners);
    mesh.uvs(vrtm::Array(s.uvs, VERTICES)).uv_indices(corners).face_counts(counts);
    return mesh;
}

vrtm::Image rigidity() { return vrtm::Image(&s.rigidity[0][0], MAP, MAP); }

vrtm::Device cpu()
{
    return *vrtm::Device::create(vrtm::DeviceDesc().set(vrtm::Backend::cpu));
}

/* An asset with its rigidity. */
vrtm::Asset ready(const vrtm::Device &device)
{
    vrtm::Asset asset = *vrtm::Asset::create(device, quads());
    const vrtm::Result<> set = asset.find_tile(1001)->set_rigidity(rigidity());
    check_that(bool(set), "an asset with a map", set.message());
    return asset;
}

Map redirection(const vrtm::Asset &asset, const vrtm::Array &points)
{
    Map map(2 * MAP * MAP);
    const vrtm::Result<> result =
        asset.redirect(points, {{*asset.find_tile(1001), vrtm::ImageOut(map, MAP, MAP)}});
    return result ? map : Map();
}

void constants()
{
    check_that(std::strcmp(vrtm::name(vrtm::Code::busy), "VRTM_ERROR_BUSY") == 0, "a status has a name", "");
    check_that(vrtm::version() == VRTM_VERSION, "the version of the library", "");
    check_that(vrtm::value(vrtm::FetchKind::warp) == VRTM_FETCH_WARP &&
                   vrtm::Weld(VRTM_WELD_OFF) == vrtm::Weld::off && vrtm::value(vrtm::Scalar::f64) == VRTM_SCALAR_F64,
               "constants have the numbers of vrtm.h", "");
}

void results()
{
    const vrtm::Result<> good;
    check_that(good && good.message()[0] == 0, "a result is good at first", "");
    vrtm::Result<vrtm_asset_info> bad = vrtm::Asset().info();
    const vrtm::Result<vrtm::Tile> other = vrtm::Asset().find_tile(1001);
    refuses("a failed result", bad, vrtm::Code::invalid_handle, "vrtm_asset_get_info");
    refuses("and another, with its own message", other, vrtm::Code::invalid_handle, "vrtm_asset_find_tile");
    check_that(bad->corners == 0 && (*bad).tiles == 0 && !*other, "has nothing to give", "");
    bad->corners = 7;
    const vrtm::Result<vrtm_asset_info> copy = bad;
    check_that(copy->corners == 7 && (*copy).corners == 7 && !copy, "and can be copied", "");
}

void arrays(const vrtm::Device &device)
{
    vrtm::Asset asset = ready(device);
    const Map expected = redirection(asset, vrtm::Array(pose, VERTICES));
    check_that(!expected.empty(), "double4 positions", vrtm_last_error());
    const double *flat = &pose[0][0];
    check_that(same(redirection(asset, {flat, VERTICES, 4 * sizeof(double)}), expected), "a stride", "");
    check_that(same(redirection(asset, {pose_f32, VERTICES}), expected), "float3 positions", "");
    check_that(same(redirection(asset, {&pose_f32[0][0], VERTICES, 12}), expected), "packed floats", "");
    struct Vector {
        float x, y, z;
        std::uint32_t flags;
    };
    std::vector<Vector> vectors;
    std::vector<double> packed;
    for (const float(&p)[3] : pose_f32) {
        vectors.push_back({p[0], p[1], p[2], 0xffffffff});
        packed.insert(packed.end(), p, p + 3);
    }
    check_that(same(redirection(asset, vrtm::Array::of<float>(vectors)), expected), "own vectors", "");
    check_that(same(redirection(asset, vrtm::Array::of<3>(packed)), expected), "packed doubles", "");
    check_that(same(redirection(asset, {vrtm::Scalar::f64, packed.data(), VERTICES, 0}), expected), "no type", "");
    refuses("a missing vertex", asset.solve({pose, VERTICES - 1}), vrtm::Code::invalid_argument, "168 elements");

    /* u and v as arrays of their own. */
    std::vector<float> u, v;
    for (const float(&uv)[2] : s.uvs) {
        u.push_back(uv[0]);
        v.push_back(uv[1]);
    }
    vrtm::Mesh mesh = quads();
    mesh.uvs(vrtm::Array::of<1>(u), vrtm::Array::of<1>(v));
    asset = *vrtm::Asset::create(device, mesh);
    works("an asset of separate u and v", asset.find_tile(1001)->set_rigidity(rigidity()));
    check_that(same(redirection(asset, {pose, VERTICES}), expected), "gives the same", "");
}

void images(const vrtm::Device &device)
{
    vrtm::Asset asset = ready(device);
    const vrtm::Tile tile = *asset.find_tile(1001);
    check_that(*tile.udim() == 1001 && tile.key()->uv_set == 0, "is 1001 of set 0", "");
    refuses("no tile has no number", vrtm::Tile().udim(), vrtm::Code::invalid_handle, "vrtm_tile_get_key");
    check_that(tile.key()->layer == 0 && tile.key()->layers == 1 && asset.find_tile(1001, 0, 0)->handle().id == tile.handle().id,
               "is its only layer", "");
    refuses("layer 1", asset.find_tile(1001, 0, 1), vrtm::Code::invalid_argument, "layer is 1");
    check_that(*asset.face_layers() == std::vector<std::uint32_t>(FACES), "has all faces", "");
    check_that(vrtm::Mesh(quads()).max_layers(5).c().max_layers == 5, "a mesh has a number of layers", "");
    const Map expected = redirection(asset, {pose, VERTICES});
    const auto gives_the_same = [&](const char *what, const vrtm::Image &image) {
        const Map none(2 * MAP * MAP);
        const vrtm::Result<> taken = tile.set_rigidity(nullptr);
        const Map without = redirection(asset, {pose, VERTICES});
        const vrtm::Result<> set = tile.set_rigidity(image);
        check_that(taken && set && !same(without, expected) && same(redirection(asset, {pose, VERTICES}), expected), what,
                   set.message());
    };
    std::vector<float> floats(MAP * MAP);
    std::vector<std::uint16_t> halves(MAP * MAP), shorts(MAP * MAP);
    std::vector<std::uint8_t> upside_down(MAP * MAP), rgba(4 * MAP * MAP + 64 * MAP, 99);
    for (int y = 0; y < MAP; ++y) {
        for (int x = 0; x < MAP; ++x) {
            const int k = y * MAP + x;
            const bool rigid = s.rigidity[y][x] != 0;
            floats[k] = rigid ? 1 : 0;
            halves[k] = rigid ? 0x3c00 : 0;
            shorts[k] = rigid ? 0xffff : 0;
            upside_down[(MAP - 1 - y) * MAP + x] = s.rigidity[y][x];
            rgba[y * (4 * MAP + 64) + 4 * x + 2] = s.rigidity[y][x];
        }
    }
    gives_the_same("an f32 image", {floats, MAP, MAP});
    gives_the_same("an f16 image", {vrtm::PixelFormat::f16, halves, MAP, MAP});
    gives_the_same("a u16 image", {vrtm::PixelFormat::u16, shorts, MAP, MAP});
    gives_the_same("a u8 image", {vrtm::PixelFormat::u8, &s.rigidity[0][0], MAP, MAP});
    gives_the_same("rows from the bottom", vrtm::Image(upside_down, MAP, MAP).origin(vrtm::Origin::bottom));
    gives_the_same("one channel of four",
                   vrtm::Image(rgba.data() + 2, MAP, MAP).pixel_stride(4).row_stride(4 * MAP + 64));

    Map rows(2 * MAP * MAP), wide(4 * MAP * MAP, -1), delta(2 * MAP * MAP), texel(2);
    works("fetch from the bottom", tile.fetch(vrtm::FetchKind::redirection,
                                                  vrtm::ImageOut(rows, MAP, MAP).origin(vrtm::Origin::bottom)));
    works("fetch two channels of four",
          tile.fetch(vrtm::FetchKind::redirection,
                         vrtm::ImageOut(wide.data() + 2, MAP, MAP, 2).pixel_stride(16).row_stride(16 * MAP)));
    works("fetch the delta", tile.fetch(vrtm::FetchKind::redirection_delta, {delta, MAP, MAP}));
    Map with_coverage(4 * MAP * MAP);
    works("fetch four channels", tile.fetch(vrtm::FetchKind::redirection_udim, {with_coverage, MAP, MAP}));
    check_that(with_coverage[4 * (MAP / 2 * MAP + MAP / 2) + 3] == 1 && with_coverage[3] == 0, "coverage", "");
    const vrtm::Result<vrtm_map_info> looked_at =
        tile.inspect_map(vrtm::MapDesc(MAP, MAP, vrtm::FetchKind::redirection_delta, vrtm::PixelFormat::f16));
    works("looks at a map", looked_at);
    check_that(looked_at->folds == 0 && looked_at->min_jacobian > 0 && looked_at->sufficient_width == MAP &&
                   looked_at->error_rms > 0 && looked_at->error_rms <= looked_at->error_p99 &&
                   looked_at->error_p99 <= looked_at->error_max && looked_at->error_max < 1.0 / int(MAP),
               "its figures", "");
    refuses("no map", tile.inspect_map({0, 1}), vrtm::Code::invalid_argument, "size");
    works("fetch a part", tile.fetch_part(vrtm::FetchKind::redirection, {texel, 1, 1}, 21, 40, MAP, MAP));
    const float texel_s_side = 1 / float(MAP);
    Map beside(2 * MAP * MAP);
    works("fetch a dilation", tile.fetch_dilation(1.0 / 16, {beside, MAP, MAP}));
    check_that(beside[0] > 0 && beside[0] < texel_s_side && beside[1] < 1 && beside[1] > 1 - texel_s_side,
               "its first texel keeps its place", "");
    refuses("a dilation without reach", tile.fetch_dilation(0, {beside, MAP, MAP}), vrtm::Code::invalid_argument,
            "reach");
    refuses("memory of a GPU on the CPU",
            tile.fetch_external(vrtm::FetchKind::redirection,
                                    vrtm::ExternalImage(0, 4 * MAP * MAP, 0, MAP, MAP)
                                        .set(vrtm::Origin::bottom)
                                        .set(vrtm::PixelFormat::f16)),
            vrtm::Code::unsupported, "the CPU");
    refuses("no memory", tile.fetch_external(vrtm::FetchKind::redirection, vrtm::ExternalImage()),
            vrtm::Code::invalid_argument, "image.handle_kind");
    std::vector<std::uint16_t> half_delta(2 * MAP * MAP);
    works("fetch f16", tile.fetch(vrtm::FetchKind::redirection_delta,
                                      {vrtm::PixelFormat::f16, half_delta, MAP, MAP}));
    bool flipped = true, channels = true, halved = true;
    for (int y = 0; y < MAP; ++y) {
        for (int x = 0; x < 2 * MAP; ++x) {
            const int k = 2 * MAP * y + x, pixel = x / 2, channel = x % 2;
            flipped = flipped && rows[2 * MAP * (MAP - 1 - y) + x] == expected[k];
            channels = channels && wide[4 * (MAP * y + pixel) + 2 + channel] == expected[k] &&
                       wide[4 * (MAP * y + pixel) + channel] == -1;
            halved = halved && ((half_delta[k] & 0x7fff) != 0) == (std::fabs(delta[k]) > 3e-8f);
        }
    }
    check_that(flipped, "rows from the bottom are those from the top", "");
    check_that(channels, "other channels are left alone", "");
    check_that(halved, "f16 is zero where f32 is", "");
    check_that(texel[0] == expected[2 * (40 * MAP + 21)] && texel[1] == expected[2 * (40 * MAP + 21) + 1],
               "the part is one texel of the whole", "");
}

void lists()
{
    const std::vector<std::uint32_t> none;
    const vrtm::Indices empty(none), unset;
    check_that(empty.data() != nullptr && empty.size() == 0, "an empty list is not null", "");
    check_that(unset.data() != nullptr && unset.size() == 0, "nor is one by default", "");
    const std::vector<int> some = {3, -1};
    const vrtm::Indices list(some);
    check_that(list.size() == 2 && list.data()[0] == 3 && list.data()[1] == UINT32_MAX, "ints are numbers", "");
    check_that(!std::is_constructible<vrtm::Indices, std::vector<int> &&>::value, "a temporary list is refused", "");
    const std::uint32_t *null = nullptr;
    check_that(vrtm::Indices(null, 3).data() == nullptr, "null that is not empty stays null", "");
}

void meshes(const vrtm::Device &device)
{
    std::vector<std::uint32_t> offsets;
    for (std::uint32_t k = 0; k <= FACES; ++k) {
        offsets.push_back(4 * k);
    }
    const auto data_of = [&](const vrtm::Mesh &mesh) {
        const vrtm::Result<vrtm::Asset> asset = vrtm::Asset::create(device, mesh);
        check_that(bool(asset), "an asset", asset.message());
        return *asset->info();
    };
    vrtm::Mesh mesh(vrtm::Array(s.points, VERTICES), corners);
    mesh.uvs(vrtm::Array(s.uvs, VERTICES)).uv_indices(corners).face_offsets(offsets);
    check_that(data_of(mesh).faces == FACES && data_of(mesh).uv_sets == 1, "face offsets", "");
    const std::vector<int> seams = {SIDE + 2, SIDE + 3, 0, 2}, half = {0, 1, 2};
    mesh.seams(seams).textured_faces(half).weld(vrtm::Weld::position, 1e-4, 1e-3);
    vrtm_asset_info data = data_of(mesh);
    check_that(data.seams_unused == 1 && data.faces_untextured == FACES - 3, "seams, and faces with texture", "");
    const vrtm_mesh_desc c = mesh.c();
    check_that(c.weld == VRTM_WELD_POSITION && c.weld_position_tolerance == 1e-4 && c.weld_uv_tolerance == 1e-3 &&
                   c.seam_count == 2,
               "welding", "");
    const std::vector<int> no_faces;
    mesh.textured_faces(no_faces);
    check_that(data_of(mesh).triangles == 0, "an empty list of faces is none, not all", "");

    /* Copies and moved meshes point into themselves. */
    std::optional<vrtm::Mesh> first(quads());
    first->add_uv_set(vrtm::UvSet(vrtm::Array(s.uvs, VERTICES)).uv_indices(corners));
    std::vector<float> u(VERTICES, 0.5f), v(VERTICES);
    for (int k = 0; k < VERTICES; ++k) {
        u[k] = 1.5f + 0.3f * s.uvs[k][1];
        v[k] = s.uvs[k][0];
    }
    first->add_uv_set(vrtm::UvSet(vrtm::Array::of<1>(u), vrtm::Array::of<1>(v)).uv_indices(corners));
    vrtm::Mesh copy(*first), assigned = quads();
    assigned = *first;
    check_that(copy.c().uv_sets[0].uvs != first->c().uv_sets[0].uvs &&
                   assigned.c().uv_sets[1].u != first->c().uv_sets[1].u,
               "a copy points into itself", "");
    vrtm::Mesh moved(std::move(*first));
    first.reset();
    check_that(data_of(copy).uv_sets == 3 && data_of(assigned).uv_sets == 3, "copies of a mesh with UV sets", "");
    assigned = std::move(moved);
    check_that(data_of(assigned).uv_sets == 3, "and moved ones", "");
    const vrtm::Asset asset = *vrtm::Asset::create(device, assigned);
    check_that(asset.find_tile(1002, 2) && !asset.find_tile(1002, 1), "each set has its own tiles", "");
    const std::vector<vrtm::Tile> tiles = *asset.tiles();
    check_that(*asset.tile_count() == 3 && tiles.size() == 3 && tiles[2] == *asset.tile(2) &&
                   tiles[1] != tiles[2],
               "tiles by their index", "");
    const vrtm_mesh_desc raw = assigned.c();
    check_that(bool(vrtm::Asset::create(device, raw)), "a mesh in the words of C", "");
    refuses("a mesh that is wrong", vrtm::Asset::create(device, quads().uv_indices(counts)),
            vrtm::Code::invalid_argument, "uv_indices");
}

void devices()
{
    vrtm::Device empty;
    check_that(!empty && empty.handle().id == 0, "an empty device", "");
    refuses("knows nothing", empty.info(), vrtm::Code::invalid_handle, "vrtm_device_get_info");
    refuses("and has no assets", vrtm::Asset::create(empty, quads()), vrtm::Code::invalid_handle, "device");
    vrtm::DeviceDesc desc;
    desc.threads = 1025;
    const vrtm::Result<vrtm::Device> wrong = vrtm::Device::create(desc);
    check_that(!*wrong, "a device that failed is empty", "");
    refuses("and says why", wrong, vrtm::Code::invalid_argument, "threads");
    vrtm::Device first = cpu();
    const vrtm_device handle = first.handle();
    check_that(vrtm::Backend(first.info()->backend) == vrtm::Backend::cpu, "a device on the CPU", "");
    vrtm::Device second(std::move(first));
    check_that(!first && second && second.handle().id == handle.id, "moves", "");
    first = std::move(second);
    check_that(first && !second, "and moves back", "");
    first.reset();
    check_that(!first && vrtm_device_destroy(handle) == VRTM_ERROR_INVALID_HANDLE, "and ends", "");
    const auto adapters = vrtm::adapters();
    std::uint32_t count = 0;
    check_that(adapters && vrtm_adapter_count(&count) == VRTM_OK && adapters->size() == count, "the adapters", "");
    if (count > 0) {
        vrtm::DeviceDesc desc;
        desc.set(vrtm::Backend::gpu);
        const vrtm_adapter_info &one = adapters->front();
        if (one.has_uuid) {
            works("a GPU by its UUID", vrtm::Device::create(desc.set_uuid(one.uuid)));
        }
        const unsigned char nobody[16] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
        refuses("no such UUID", vrtm::Device::create(desc.set_uuid(nobody)), vrtm::Code::invalid_argument,
                "no adapter has the UUID 01020304-0506-0708-090a-0b0c0d0e0f10");
        refuses("no such LUID", vrtm::Device::create(desc.set_luid(nobody)), vrtm::Code::invalid_argument,
                "no adapter has the LUID 0102030405060708;");
        refuses("no such registry ID", vrtm::Device::create(desc.set_registry_id(77)),
                vrtm::Code::invalid_argument, "no adapter has the registry ID 77;");
    }
}

void logs()
{
    const std::vector<int> no_edge = {0, 2};
    const auto said = std::make_shared<std::vector<vrtm_log_entry>>();
    vrtm::Asset asset;
    {
        auto mine = said;
        vrtm::DeviceDesc desc;
        desc.set(vrtm::Backend::cpu).set_log([mine](const vrtm_log_entry &entry) {
            mine->push_back(entry);
#if VRTM_EXCEPTIONS
            throw std::runtime_error("not the library's business");
#endif
        });
        const vrtm::Device device = *vrtm::Device::create(desc);
        asset = *vrtm::Asset::create(device, quads().seams(no_edge));
    }
    bool warned = false;
    for (const vrtm_log_entry &entry : *said) {
        const bool unused = entry.code == VRTM_LOG_CODE_SEAMS_UNUSED && entry.values[0] == 1;
        warned = warned || (unused && entry.level == VRTM_LOG_LEVEL_WARNING);
    }
    check_that(asset && warned, "a lambda as log", "");
    const long users = said.use_count();
    asset.reset();
    check_that(users == 2 && said.use_count() == 1, "the asset keeps the log alive, and lets it go", "");
}

/* A log function calls back into the library: it finds the asset busy for whose call it is, and makes a device. */
void logs_that_call_back()
{
    /* The sheet is folded in UV: the solve that finds the overlap logs a warning. */
    float folded[VERTICES][2];
    for (int k = 0; k < VERTICES; ++k) {
        folded[k][0] = std::fmin(s.uvs[k][0], 1 - s.uvs[k][0]);
        folded[k][1] = s.uvs[k][1];
    }
    vrtm::Tile tile;
    int calls = 0, refused = 0, made = 0;
    vrtm::DeviceDesc desc;
    desc.set(vrtm::Backend::cpu).set_log([&](const vrtm_log_entry &) {
        calls += 1;
        refused += tile && tile.info().code() == vrtm::Code::busy;
        made += bool(vrtm::Device::create(vrtm::DeviceDesc().set(vrtm::Backend::cpu)));
    });
    const vrtm::Device device = *vrtm::Device::create(desc);
    const vrtm::Asset asset = *vrtm::Asset::create(device, quads().uvs(vrtm::Array(folded, VERTICES)));
    tile = *asset.find_tile(1001);
    works("a map", tile.set_rigidity(rigidity()));
    works("a solve that has something to say", asset.solve({s.points, VERTICES}));
    check_that(calls > 0 && made == calls, "a log function may call back", "");
    check_that(refused > 0 && tile.info()->overlap > 0, "and finds the asset busy, which it is no longer then", "");
}

/* The threads of a host that has one: loops run on the calling thread. */
struct LoopsOnly {
    std::atomic<int> loops{0};
    void parallel_for(std::size_t count, vrtm::Task task)
    {
        loops += 1;
        for (std::size_t i = count; i > 0; --i) {
            task(i - 1);
        }
    }
};

/* And jobs run when the host comes to them. */
struct Pool : LoopsOnly {
    std::vector<vrtm::Task> queue;
    void spawn(vrtm::Task task) { queue.push_back(task); }
};

void executors(const Map &expected)
{
    const auto pool = std::make_shared<Pool>();
    vrtm::DeviceDesc desc;
    desc.set(vrtm::Backend::cpu).set_executor(pool);
    desc.threads = 3;
    vrtm::Asset asset = ready(*vrtm::Device::create(desc));
    check_that(same(redirection(asset, {pose, VERTICES}), expected) && pool->loops > 0, "a host's threads", "");
    vrtm::Job job = *asset.submit({s.points, VERTICES});
    check_that(pool->queue.size() == 1 && job.wait_for(std::chrono::milliseconds(0)).code() == vrtm::Code::timeout,
               "a job waits in the host's queue", "");
    pool->queue.at(0)();
    pool->queue.clear();
    works("and is done when the host has run it", job.wait_for(std::chrono::milliseconds(0)));
    desc = vrtm::DeviceDesc();
    check_that(pool.use_count() > 1, "the asset keeps the host's threads alive", "");
    asset.reset();
    check_that(pool.use_count() > 1, "and so does a job without it", "");
    job.reset();
    check_that(pool.use_count() == 1, "which lets them go", "");

    const auto loops = std::make_shared<LoopsOnly>();
    desc.set(vrtm::Backend::cpu).set_executor(loops);
    desc.threads = 2;
    asset = ready(*vrtm::Device::create(desc));
    job = *asset.submit({pose, VERTICES});
    works("an executor without a queue", job.wait());
    check_that(loops->loops > 0, "runs the loops", "");
}

/* A host's memory, which can run out. */
struct Memory {
    std::atomic<long> blocks{0}, taken{0};
    std::atomic<bool> empty{false};

    void *allocate(std::size_t size, std::size_t alignment)
    {
        void *pointer = empty ? nullptr : platform_allocate(alignment, size);
        if (pointer == nullptr) {
            return nullptr;
        }
        blocks += 1;
        taken += 1;
        return pointer;
    }
    void deallocate(void *pointer, std::size_t, std::size_t)
    {
        platform_free(pointer);
        blocks -= 1;
    }
};

void allocators(const Map &expected)
{
    const auto memory = std::make_shared<Memory>();
    vrtm::DeviceDesc desc;
    desc.set(vrtm::Backend::cpu).set_allocator(memory);
    vrtm::Asset asset = ready(*vrtm::Device::create(desc));
    desc = vrtm::DeviceDesc();
    check_that(same(redirection(asset, {pose, VERTICES}), expected) && memory->taken > 0, "a host's memory", "");
    memory->empty = true;
    refuses("which has run out", asset.find_tile(1001)->set_rigidity(rigidity()), vrtm::Code::out_of_memory, "");
    memory->empty = false;
    check_that(memory->blocks > 0 && memory.use_count() > 1, "is kept by the asset", "");
    asset.reset();
    check_that(memory->blocks == 0 && memory.use_count() == 1, "which gives all of it back", "");
}

void tiles(const vrtm::Device &device)
{
    const vrtm::Tile none;
    check_that(!none && none == vrtm::Tile(vrtm_tile{}), "an empty tile", "");
    refuses("knows nothing", none.info(), vrtm::Code::invalid_handle, "vrtm_tile_get_info");
    vrtm::Asset asset = ready(device);
    const vrtm::Tile tile = *asset.find_tile(1001);
    check_that(tile && vrtm::Tile(tile.handle()) == tile && tile != none, "a tile", "");
    refuses("has no report yet", tile.report(), vrtm::Code::not_solved, "vrtm_tile_get_report");
    check_that(tile.info()->udim == 1001 && tile.info()->grid_width == tile.grid()->width, "its data", "");
    check_that(tile.estimate()->movable_nodes > 0, "its needs", "");

    vrtm::TileSettings settings;
    settings.set(vrtm::Overlap::first_face).set(vrtm::Seams::go_on).set(vrtm::OpenBorders::slide).grid_width = 128;
    settings.grid_height = 96;
    works("settings", tile.set_settings(settings));
    const vrtm::TileSettings read = *tile.settings();
    check_that(read.grid_width == 128 && vrtm::Overlap(read.overlap) == vrtm::Overlap::first_face &&
                   vrtm::OpenBorders(read.open_borders) == vrtm::OpenBorders::slide &&
                   tile.info()->grid_height == 96,
               "are taken", "");
    settings.room = -3;
    refuses("wrong settings", tile.set_settings(settings), vrtm::Code::invalid_argument, "room");
    works("no settings", tile.set_settings(nullptr));
    check_that(tile.settings()->grid_width == 0 && tile.info()->grid_width == tile.grid()->width, "are the defaults", "");

    const Map expected = redirection(asset, {pose, VERTICES});
    check_that(tile.report()->udim == 1001 && tile.report()->folds == 0, "a report", "");
    check_that(tile.worst_features() && tile.worst_features()->empty(), "no features without measure", "");
    const std::vector<std::uint8_t> fixed(MAP * MAP, 0);
    works("a mask", tile.set_mask({fixed, MAP, MAP}));
    check_that(!same(redirection(asset, {pose, VERTICES}), expected), "holds all", "");
    works("no mask", tile.set_mask(nullptr));
    check_that(same(redirection(asset, {pose, VERTICES}), expected), "lets all go", "");

    /* A stroke, and the same map as a whole. */
    sheet painted = s;
    for (int y = 20; y < 30; ++y) {
        std::memset(&painted.rigidity[y][8], 255, 24);
    }
    const vrtm::Image map(&painted.rigidity[0][0], MAP, MAP);
    works("a stroke", tile.update_rigidity(map, 8, 20, 24, 10));
    const Map stroked = redirection(asset, {pose, VERTICES});
    works("the whole map", tile.set_rigidity(map));
    check_that(!same(stroked, expected) && same(redirection(asset, {pose, VERTICES}), stroked), "are the same", "");
    refuses("a stroke beside the map", tile.update_rigidity(map, 60, 0, 8, 1), vrtm::Code::invalid_argument, "8x1");

    const std::vector<unsigned char> saved = *tile.save();
    const vrtm::Result<std::size_t> size = tile.save(nullptr, 0);
    std::vector<unsigned char> again(*size);
    check_that(size && *size == saved.size() && *tile.save(again.data(), again.size()) == *size && again == saved,
               "a saved tile", "");
    refuses("too little room", tile.save(again.data(), 1), vrtm::Code::invalid_argument, "capacity");
    const vrtm::Asset other = ready(device);
    refuses("a tile of another map", other.find_tile(1001)->load(saved), vrtm::Code::invalid_argument, "");
    works("its own map", other.find_tile(1001)->set_rigidity(map));
    works("loads", other.find_tile(1001)->load(saved));
    works("from the caller's memory", other.find_tile(1001)->load(saved.data(), saved.size()));
    check_that(same(redirection(other, {pose, VERTICES}), stroked), "and solves the same", "");

    works("freeze", tile.freeze(true));
    check_that(same(redirection(asset, {s.points, VERTICES}), stroked) && tile.report()->kept == 1, "keeps", "");
    works("let go", tile.freeze(false));
    check_that(!same(redirection(asset, {s.points, VERTICES}), stroked), "solves again", "");
}

void outputs(const vrtm::Device &device)
{
    vrtm::Asset asset = ready(device);
    const vrtm::Tile tile = *asset.find_tile(1001);
    refuses("no corner UVs yet", asset.corner_uvs(), vrtm::Code::not_solved, "");
    refuses("no report yet", asset.report(), vrtm::Code::not_solved, "vrtm_asset_get_report");
    const Map expected = redirection(asset, {pose, VERTICES});
    Map map(2 * MAP * MAP), warp(2 * (MAP + 1) * (MAP + 1)), fetched(warp.size());
    /* The descriptions of the images are gone when the list is used. */
    vrtm::Fetches fetches;
    {
        const vrtm::ImageOut image(map, MAP, MAP), nodes(warp, MAP + 1, MAP + 1);
        fetches.add({tile, image});
        for (int i = 0; i < 100; ++i) {
            fetches.add({tile, nodes, vrtm::FetchKind::warp});
        }
    }
    check_that(fetches.size() == 101 && fetches.c()[0].image->data == map.data() &&
                   fetches.c()[100].image->data == warp.data() && fetches.c()[100].kind == VRTM_FETCH_WARP,
               "a list that grows keeps its images", "");
    refuses("images that overlap", asset.redirect({pose, VERTICES}, fetches), vrtm::Code::invalid_argument,
            "fetches");
    fetches = {{tile, {map, MAP, MAP}}, {tile, {warp, MAP + 1, MAP + 1}, vrtm::FetchKind::warp}};
    const vrtm::Fetches copy(fetches), moved(std::move(fetches));
    vrtm::SolveOptions options;
    options.threads = 1;
    works("a list that was copied", asset.redirect({pose, VERTICES}, copy, options));
    check_that(same(map, expected) && copy.c()[0].image != moved.c()[0].image, "has images of its own", "");
    works("a list that was moved", asset.redirect({pose, VERTICES}, moved));
    works("the warp", tile.fetch(vrtm::FetchKind::warp, {fetched, MAP + 1, MAP + 1}));
    check_that(same(warp, fetched), "is what fetch gives", "");

    const vrtm::Result<std::vector<float>> uvs = asset.corner_uvs();
    Map own(2 * CORNERS), of_set(2 * CORNERS);
    works("corner UVs", uvs);
    works("into a buffer", asset.corner_uvs(own));
    works("of a UV set", asset.corner_uvs(of_set, 0));
    check_that(same(own, *uvs) && same(of_set, own) && own.size() == 2 * CORNERS, "are the same", "");
    refuses("a UV set that is not there", asset.corner_uvs(1), vrtm::Code::invalid_argument, "uv_set");
    check_that(asset.report()->tiles == 1 && asset.report()->folds == 0, "an asset's report", "");
    check_that(asset.report()->scale > 0, "has the stretch of the pose's edges", "");

    const std::vector<float> elastic(VERTICES, 0), rigid(VERTICES, 1);
    works("no map", tile.set_rigidity(nullptr));
    works("rigidity per vertex", asset.set_vertex_rigidity({rigid.data(), VERTICES}));
    check_that(tile.estimate()->movable_nodes > 0 && tile.info()->grid_width == 64, "is taken", "");
    works("a mask per vertex", asset.set_vertex_mask({elastic.data(), VERTICES}));
    check_that(tile.estimate()->movable_nodes == 0, "holds all", "");
    works("no mask per vertex", asset.set_vertex_mask(nullptr));
    check_that(tile.estimate()->movable_nodes > 0, "holds nothing", "");
    refuses("too little of a mask", asset.set_vertex_mask({elastic.data(), 3}), vrtm::Code::invalid_argument,
            "3 elements");
    works("no rigidity per vertex", asset.set_vertex_rigidity(nullptr));
    refuses("too little of it", asset.set_vertex_rigidity({elastic.data(), 3}), vrtm::Code::invalid_argument,
            "3 elements");
}

void options(const vrtm::Device &device, const Map &expected)
{
    /* Two tiles: the sheet's UVs, and a second set of them in 1002. */
    std::vector<float> moved;
    for (const float(&uv)[2] : s.uvs) {
        moved.push_back(uv[0] + 1);
        moved.push_back(uv[1]);
    }
    vrtm::Mesh mesh = quads();
    mesh.add_uv_set(vrtm::UvSet(vrtm::Array::of<2>(moved)).uv_indices(corners));
    const vrtm::Asset asset = *vrtm::Asset::create(device, mesh);
    const std::vector<vrtm::Tile> tiles = *asset.tiles();
    for (const vrtm::Tile tile : tiles) {
        works("a map", tile.set_rigidity(rigidity()));
    }
    const auto kept = [&] { return std::array<int, 2>{int(tiles[0].report()->kept), int(tiles[1].report()->kept)}; };
    const std::array<int, 2> neither{0, 0}, second{0, 1}, both{1, 1};
    vrtm::SolveOptions all;
    works("all tiles", asset.solve({s.points, VERTICES}));
    vrtm::SolveOptions one;
    one.set_tiles({tiles[0]});
    works("one tile", asset.solve({pose, VERTICES}, one));
    check_that(kept() == second, "is solved", "");
    vrtm::SolveOptions copy(one);
    one = vrtm::SolveOptions();
    works("a copy of the options", asset.solve({s.points, VERTICES}, copy));
    check_that(kept() == second, "has the tile, too", "");
    works("a list without tiles", asset.solve({pose, VERTICES}, copy.set_tiles({})));
    check_that(kept() == both, "is none, not all", "");
    works("all tiles again", asset.solve({pose, VERTICES}, copy.set_all_tiles()));
    check_that(kept() == neither, "are solved", "");
    const std::vector<int> none, some = {5};
    works("no dirty vertex", asset.solve({s.points, VERTICES}, all.set_dirty_vertices(none)));
    check_that(kept() == both, "solves nothing", "");
    works("one dirty vertex", asset.solve({s.points, VERTICES}, all.set_dirty_vertices(some)));
    check_that(kept() == neither, "solves its tiles", "");
    works("no vertex, by an empty list", asset.solve({pose, VERTICES}, all.set_dirty_vertices({})));
    check_that(kept() == both, "solves nothing", "");
    works("any vertex", asset.solve({pose, VERTICES}, all.set_all_dirty()));
    check_that(kept() == neither, "solves all", "");
    check_that(same(redirection(asset, {pose, VERTICES}), expected), "with the bits of a tile alone", "");
    vrtm::SolveOptions draft;
    draft.set(vrtm::Quality::draft).set(vrtm::Solver::pbd).pbd.iterations = 1;
    check_that(draft.quality == VRTM_QUALITY_DRAFT && draft.solver == VRTM_SOLVER_PBD, "quality and solver", "");
    works("the paper's solver", asset.solve({pose, VERTICES}, draft));
    draft.pbd.damping = 2;
    refuses("a wrong option", asset.solve({pose, VERTICES}, draft), vrtm::Code::invalid_argument, "damping");
    draft.set(vrtm::Scale::follow).replace = 1;
    check_that(draft.c().replace == 1 && draft.c().scale == VRTM_SCALE_FOLLOW, "newest pose and scale", "");
}

void refinements(const vrtm::Device &device)
{
    const vrtm::Refinement empty;
    check_that(!empty && empty.handle().id == 0, "an empty refinement", "");
    refuses("has no pattern", empty.pattern(), vrtm::Code::invalid_handle, "refinement");
    refuses("and no UVs", empty.corner_uvs(), vrtm::Code::invalid_handle, "refinement");
    vrtm::Asset asset = ready(device);
    refuses("a refinement before a solve", asset.refine(), vrtm::Code::not_solved, "solve first");
    works("a solve", asset.solve({s.points, VERTICES}));
    vrtm::RefinementDesc desc;
    desc.tolerance = 1e-3;
    vrtm::Refinement refinement = *asset.refine(desc);
    check_that(refinement.info()->faces == FACES, "nothing to refine", "");
    works("a pose", asset.solve({pose, VERTICES}));
    works("extend", refinement.extend());
    const vrtm_refinement_info data = *refinement.info();
    check_that(data.faces > FACES && data.reached == 1 && data.error <= desc.tolerance, "refines", "");
    const vrtm::RefinementPattern pattern = *refinement.pattern();
    check_that(pattern.face_sources.size() == data.faces && pattern.corner_uvs.size() == 2 * data.corners &&
                   pattern.vertex_sources[3 * (VERTICES - 1)] == VERTICES - 1,
               "its pattern", "");
    std::vector<float> uvs(2 * static_cast<std::size_t>(data.corners));
    works("corner UVs", refinement.corner_uvs(uvs));
    check_that(uvs == *refinement.corner_uvs() && uvs != pattern.corner_uvs, "are redirected", "");
    asset.reset();
    const vrtm::Refinement moved(std::move(refinement));
    check_that(!refinement && moved.info()->corners == data.corners, "it goes on without the asset", "");
    desc.tolerance = 2;
    refuses("a wrong tolerance", ready(device).refine(desc), vrtm::Code::invalid_argument, "tolerance");
}

void carriers(const vrtm::Device &device)
{
    const vrtm::Carrier empty;
    check_that(!empty && empty.handle().id == 0, "an empty carrier", "");
    refuses("has no points", empty.states(), vrtm::Code::invalid_handle, "carrier");
    vrtm::Asset asset = ready(device);
    const float uvs[] = {0.5F, 0.5F, 0.25F, 0.75F};
    const vrtm::Array at = vrtm::Array::of<2>(uvs);
    vrtm::CarrierDesc desc;
    vrtm::Carrier carrier = *asset.carrier(desc.at_uvs(at));
    check_that(carrier.info()->points == 2 && carrier.states()->size() == 2, "two points", "");
    double points[2][4] = {{0, 0, 0, 7}, {0, 0, 0, 7}};
    const vrtm::ArrayOut out(points, 2);
    refuses("a fetch before a solve", carrier.positions(out), vrtm::Code::not_solved, "");
    works("a pose", asset.solve({pose, VERTICES}));
    works("positions", carrier.positions(out));
    check_that((points[0][0] != 0 || points[0][1] != 0) && points[1][3] == 7, "are carried", "");
    float turns[2][4];
    const vrtm::ArrayOut rotations(turns, 2);
    vrtm::Carried carried;
    carried.rotations = &rotations.c();
    works("rotations", carrier.fetch(carried));
    const float expected = turns[1][2];
    turns[1][2] = 9;
    std::vector<float> map(8 * 8 * 2);
    vrtm::Fetches fetches;
    fetches.add(carrier.handle(), carried).add({*asset.find_tile(1001), {map, 8, 8}});
    const vrtm::Fetches copy(fetches);
    works("an image and points of one solve", asset.redirect({pose, VERTICES}, copy));
    check_that(turns[1][2] == expected && map[2 * 63] > 0.5F, "both are written", "");
    const std::uint32_t corners[] = {0, 1, 2};
    const float weights[] = {1, 1, 1};
    const vrtm::Array of_corners = vrtm::Array::of<3>(weights);
    const vrtm::Carrier skin =
        *asset.carrier(vrtm::CarrierDesc().set(vrtm::Fit::none).at_corners({corners, 3}, of_corners));
    check_that(skin.states()->at(0) == vrtm::PointState::bound, "a point at corners is bound", "");
    const vrtm::Array places(points, 2);
    const vrtm::Carrier other_one = *asset.carrier(vrtm::CarrierDesc().at_nearest(places, 0.5));
    asset.reset();
    const vrtm::Carrier moved(std::move(carrier));
    check_that(!carrier && moved.info()->points == 2 && other_one, "it goes on without the asset", "");
    refuses("no points", ready(device).carrier(vrtm::CarrierDesc()), vrtm::Code::invalid_argument, "uvs");
}

/* Memory of another length than its use has is refused, with the argument's name, before it is touched. */
void lengths(const vrtm::Device &device)
{
    using Kind = vrtm::FetchKind;
    const auto wrong = [](const char *text, const vrtm::Result<> &result) {
        refuses(text, result, vrtm::Code::invalid_argument, text);
    };
    const vrtm::Asset asset = ready(device);
    const vrtm::Tile tile = *asset.find_tile(1001);
    works("a pose", asset.solve({pose, VERTICES}));

    Map pairs(CORNERS), xyz(&pose_f32[0][0], &pose_f32[0][0] + 3 * VERTICES);
    wrong("desc.positions.stride", vrtm::Asset::create(device, {vrtm::Array(xyz.data(), xyz.size()), corners}));
    wrong("positions.stride is 4 bytes", asset.solve({xyz.data(), xyz.size()}));
    wrong("positions.stride is 8 bytes", asset.submit(vrtm::Array::of<2>(pairs)));
    wrong("rigidity: 507 elements", asset.set_vertex_rigidity(vrtm::Array::of<1>(xyz)));
    xyz.push_back(0);
    wrong("positions.stride is 1 bytes", asset.solve(vrtm::Array::of<3>(xyz)));
    const std::vector<int> three = {0, 1, 2};
    wrong("mesh.seams: an odd number", vrtm::Asset::create(device, quads().seams(three)));

    Map two(vrtm::image_size(Kind::warp, MAP, MAP)), four(vrtm::image_size(Kind::jacobian, MAP, MAP));
    Map one(vrtm::image_size(Kind::filter_scale, MAP, MAP)), odd(two.size() - 1), short_row(MAP);
    works("a Jacobian", tile.fetch(Kind::jacobian, {four, MAP, MAP}));
    works("a filter scale", tile.fetch(Kind::filter_scale, {one, MAP, MAP}));
    const bool fits = bool(vrtm::ImageOut(one, MAP, MAP).fits("one"));
    check_that(one[0] > 0 && fits && vrtm::channels(Kind::carried) == 0, "with one value per texel", "");
    wrong("image: 2 channels, but its kind has 4", tile.fetch(Kind::jacobian, {two, MAP, MAP}));
    wrong("image: 2 channels, but its kind has 4", tile.fetch(Kind::jacobian, {two.data(), MAP, MAP, 2}));
    wrong("image: 1 channels", tile.fetch_dilation(0.1, {one, MAP, MAP}));
    wrong("image: a list of 8191 values is no image of 64 x 64 texels", tile.fetch(Kind::warp, {odd, MAP, MAP}));
    wrong("image: a list of 64 values", tile.fetch_part(Kind::warp, {short_row, MAP, MAP}, 0, 0, MAP, MAP));
    wrong("image: a list of 16384 values", tile.fetch_dilation(0.1, {four, 64, 32}));
    wrong("fetches[1].image: 2 channels",
          asset.redirect({pose, VERTICES}, {{tile, {four, MAP, MAP}}, {tile, {two, MAP, MAP}, Kind::jacobian}}));
    wrong("fetches[1].image: a list of 64 values",
          asset.redirect({pose, VERTICES}, {{tile, {four, MAP, MAP}}, {tile, {short_row, MAP, MAP}}}));
    wrong("rigidity: a list of 8192 values is no image of 64 x 64 texels with 1 channel",
          tile.set_rigidity({two, MAP, MAP}));
    wrong("rigidity: a list of 64 values", tile.update_rigidity({short_row, MAP, MAP}, 0, 0, 1, 1));
    wrong("mask: a list of 8191 values", tile.set_mask({odd, MAP, MAP}));

    wrong("count is 288, but", asset.corner_uvs(pairs));
    const vrtm::Array weights = vrtm::Array::of<3>(pairs);
    wrong("desc.corners is null", asset.carrier(vrtm::CarrierDesc().at_corners(three, weights)));
    const vrtm::Array at = vrtm::Array::of<2>(pairs);
    const vrtm::Carrier carrier = *asset.carrier(vrtm::CarrierDesc().at_uvs(at));
    wrong("positions.stride is 8 bytes", carrier.positions(vrtm::ArrayOut::of<2>(pairs)));
    wrong("positions.count is", carrier.positions(vrtm::ArrayOut::of<4>(pairs)));
}

/* A solve that takes a while: 1024 x 1024 cells. */
vrtm::Asset slow(const vrtm::Device &device)
{
    vrtm::Asset asset = ready(device);
    vrtm::TileSettings settings;
    settings.grid_width = settings.grid_height = 1024;
    works("a large grid", asset.find_tile(1001)->set_settings(settings));
    return asset;
}

void progress(const vrtm::Device &device)
{
    const vrtm::Asset asset = slow(device);
    std::vector<float> told;
    vrtm::SolveOptions options;
    options.set(vrtm::Quality::normal).set_progress([&told](float done) {
        told.push_back(done);
        return vrtm::Proceed::yes;
    });
    const vrtm::SolveOptions copy(options);
    works("a solve with progress", asset.solve({pose, VERTICES}, copy));
    bool rises = !told.empty();
    for (std::size_t i = 1; i < told.size(); ++i) {
        rises = rises && told[i] >= told[i - 1] && told[i] <= 1;
    }
    check_that(rises, "tells how far it is", "");
    options.set_progress([](float) { return vrtm::Proceed::no; });
    refuses("a function that cancels", asset.solve({other, VERTICES}, options), vrtm::Code::cancelled, "");
#if VRTM_EXCEPTIONS
    options.set_progress([](float) -> vrtm::Proceed { throw std::runtime_error("stop"); });
    refuses("one that throws", asset.solve({other, VERTICES}, options), vrtm::Code::cancelled, "");
#endif
    options.set_progress(nullptr);
    works("no function", asset.solve({other, VERTICES}, options));
}

void jobs(const vrtm::Device &device)
{
    const vrtm::Job empty;
    check_that(!empty && empty.handle().id == 0, "an empty job", "");
    refuses("cannot be waited for", empty.wait(), vrtm::Code::invalid_handle, "vrtm_job_wait");
    const vrtm::Asset asset = slow(device);
    const vrtm::Result<vrtm::Job> wrong = asset.submit({s.uvs, VERTICES});
    check_that(!*wrong, "a job that failed is empty", "");
    refuses("and says why", wrong, vrtm::Code::invalid_argument, "positions");

    std::atomic<int> calls{0};
    const auto owned = std::make_shared<int>(1);
    vrtm::Job job;
    {
        /* Options and function are gone while the job runs. */
        vrtm::SolveOptions options;
        options.set(vrtm::Quality::normal).set_progress([&calls, owned](float) {
            calls += *owned;
            return vrtm::Proceed::yes;
        });
        job = *asset.submit({pose, VERTICES}, options);
    }
    check_that(job && owned.use_count() == 2, "a job keeps its function", "");
    refuses("the asset is busy", asset.solve({pose, VERTICES}), vrtm::Code::busy, "");
    vrtm::Job moved(std::move(job));
    refuses("and the job not done at once", moved.wait_for(std::chrono::microseconds(1)), vrtm::Code::timeout, "");
    check_that(!job && moved.progress()->state == vrtm::JobState::running, "it runs", "");
    works("wait", moved.wait());
    const vrtm::JobProgress data = *moved.progress();
    check_that(data.state == vrtm::JobState::done && data.code == vrtm::Code::ok && data.progress == 1 &&
                   data.time > std::chrono::microseconds(1),
               "it is done", "");
    works("wait for hours", moved.wait_for(std::chrono::hours(24 * 365)));
    works("cancel what is done", moved.cancel());
    works("changes nothing", moved.wait_for(std::chrono::duration<double>(-1)));
    moved.reset();
    check_that(calls > 0 && !moved && owned.use_count() == 1, "its function goes with it", "");

    job = *asset.submit({other, VERTICES});
    works("cancel", job.cancel());
    refuses("ends it", job.wait(), vrtm::Code::cancelled, "cancelled");
    job.reset();
    job = *asset.submit({other, VERTICES});
    works("cancel the asset's solve", asset.cancel());
    refuses("ends it, too", job.wait(), vrtm::Code::cancelled, "cancelled");
    job.reset();
    { const vrtm::Job forgotten = *asset.submit({other, VERTICES}); }
    works("a forgotten job is over", asset.solve({pose, VERTICES}));
}

} // namespace

int main()
{
    sheet_make(&s);
    sheet_pose(&s, 5, pose);
    sheet_pose(&s, 9, other);
    for (int k = 0; k < VERTICES; ++k) {
        for (int i = 0; i < 3; ++i) {
            pose_f32[k][i] = static_cast<float>(pose[k][i]);
            pose[k][i] = pose_f32[k][i];
        }
    }
    std::copy(s.counts, s.counts + FACES, counts.begin());
    std::copy(s.indices, s.indices + CORNERS, corners.begin());
    const vrtm::Device device = cpu();
    const Map expected = redirection(ready(device), {pose, VERTICES});
    constants();
    results();
    arrays(device);
    images(device);
    lists();
    meshes(device);
    devices();
    logs();
    logs_that_call_back();
    executors(expected);
    allocators(expected);
    tiles(device);
    outputs(device);
    lengths(device);
    options(device, expected);
    progress(device);
    jobs(device);
    refinements(device);
    carriers(device);
    return finish();
}
