/*
 * A viewport: the mouse moves, the pose is submitted, and drawing goes on with the last result while the next one is
 * computed. A mouse move before it is done replaces it. Nothing in the loop waits for a solve, and no call finds the
 * asset busy.
 */

#include "check.h"
#include "vrtm.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>

namespace {

using Clock = std::chrono::steady_clock;

const std::uint32_t screen = 128;
sheet s;

double ms_since(Clock::time_point start)
{
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

using Pose = std::vector<double>;
using Picture = std::vector<float>;

Pose pose_at(int frame)
{
    Pose pose(4 * VERTICES);
    sheet_pose(&s, frame, reinterpret_cast<double(*)[4]>(pose.data()));
    return pose;
}

vrtm::Array points(const Pose &pose) { return {pose.data(), VERTICES, 4 * sizeof(double)}; }

class Viewport {
public:
    Viewport(const vrtm::Device &device, std::uint32_t grid)
    {
        const vrtm::Indices corners(s.indices, CORNERS), counts(s.counts, FACES);
        vrtm::Mesh mesh(vrtm::Array(s.points, VERTICES), corners);
        mesh.uvs(vrtm::Array(s.uvs, VERTICES)).uv_indices(corners).face_counts(counts);
        asset_ = vrtm::Asset::create(device, mesh).value();
        tile_ = asset_.find_tile(1001).value();
        tile_.set_rigidity({&s.rigidity[0][0], MAP, MAP}).value();
        vrtm::TileSettings settings;
        settings.grid_width = settings.grid_height = grid;
        tile_.set_settings(settings).value();
    }

    /* The picture of a pose, without any haste. */
    Picture still(const Pose &pose)
    {
        asset_.solve(points(pose)).value();
        return draw();
    }

    /* The mouse was moved: what is being computed is of no use any more. Tells whether it was cancelled. */
    bool mouse_moved(const Pose &pose)
    {
        vrtm::SolveOptions options;
        options.replace = 1;
        const Clock::time_point start = Clock::now();
        vrtm::Job next = asset_.submit(points(pose), options).value();
        const double ms = ms_since(start);
        const bool cancelled = job_ && job_.wait().code() == vrtm::Code::cancelled;
        if (cancelled) {
            replacements.push_back(ms);
        }
        longest_submit = std::max(longest_submit, ms);
        last_progress_ = 0;
        job_ = std::move(next);
        return cancelled;
    }

    /* One frame of the screen: the last result. */
    Picture draw()
    {
        Picture picture(2 * screen * screen);
        Clock::time_point start = Clock::now();
        const vrtm::Result<> fetched = tile_.fetch(vrtm::FetchKind::redirection, {picture, screen, screen});
        longest_fetch = std::max(longest_fetch, ms_since(start));
        start = Clock::now();
        const vrtm::Result<vrtm_tile_report> report = tile_.report();
        const vrtm::Result<vrtm::Tile> found = asset_.find_tile(1001);
        longest_other = std::max(longest_other, ms_since(start));
        refused += !fetched || !report || !found;
        return picture;
    }

    /* Whether the job is done; never waits. */
    bool ready()
    {
        const Clock::time_point start = Clock::now();
        const vrtm::JobProgress data = job_.progress().value();
        longest_other = std::max(longest_other, ms_since(start));
        rises = rises && data.progress >= last_progress_;
        last_progress_ = data.state == vrtm::JobState::done ? 0 : data.progress;
        if (data.state != vrtm::JobState::done) {
            return false;
        }
        refused += data.code != vrtm::Code::ok;
        job_.reset();
        return true;
    }

    bool busy() const { return bool(job_); }

    double longest_fetch = 0, longest_submit = 0, longest_other = 0;
    int refused = 0;
    bool rises = true;
    std::vector<double> replacements;

private:
    vrtm::Asset asset_;
    vrtm::Tile tile_;
    vrtm::Job job_;
    float last_progress_ = 0;
};

/*
 * The mouse moves again after so many milliseconds, mostly before the solve is done. Each picture that is drawn is that
 * of the last pose that was done; once it is the new one, it stays that.
 */
void drag(Viewport &view, const std::vector<Pose> &poses, const std::vector<Picture> &pictures)
{
    std::size_t shown = 0, next = 0;
    int torn = 0, during = 0;
    const auto move_to = [&](std::size_t pose) {
        const bool busy = view.busy();
        if (!view.mouse_moved(poses[pose]) && busy) {
            /* The one before was done in the end. */
            shown = next;
        }
        next = pose;
    };
    const auto draw = [&] {
        const Picture picture = view.draw();
        /* It may be done before the loop hears of it. */
        shown = picture == pictures[next] ? next : shown;
        torn += picture != pictures[shown];
        during += view.busy();
    };
    for (int move = 0; move < 40; ++move) {
        move_to(1 + std::size_t(move) % (poses.size() - 1));
        const Clock::time_point start = Clock::now();
        while (ms_since(start) < 1.5 * (move % 16)) {
            draw();
            std::this_thread::sleep_for(std::chrono::microseconds(500));
        }
        if (view.ready()) {
            shown = next;
        }
    }
    check_that(view.replacements.size() > 10, "solves were replaced", std::to_string(view.replacements.size()).c_str());
    for (std::size_t pose = 1; pose < poses.size(); ++pose) {
        move_to(pose);
        do {
            draw();
        } while (!view.ready());
        shown = pose;
        torn += view.draw() != pictures[pose];
    }
    check_that(during > 40 && view.refused == 0, "pictures were drawn meanwhile, and no call was refused", "");
    check_that(torn == 0, "each was the last result, bit for bit", std::to_string(torn).c_str());
    check_that(view.rises, "progress never falls", "");
}

void at(const vrtm::Device &device, std::uint32_t grid)
{
    Viewport view(device, grid);
    std::vector<Pose> poses;
    std::vector<Picture> pictures;
    double solve = 0;
    for (int frame = 1; frame < 5; ++frame) {
        poses.push_back(pose_at(frame));
        const Clock::time_point start = Clock::now();
        pictures.push_back(view.still(poses.back()));
        solve = ms_since(start);
    }
    view.still(poses[0]);
    const double idle_fetch = view.longest_fetch;
    view.longest_fetch = view.longest_other = 0;
    drag(view, poses, pictures);
    char line[400];
    std::snprintf(line, sizeof line,
                  "%u x %u cells, a solve takes %.0f ms: longest fetch of %u x %u texels %.2f ms (%.2f ms without a "
                  "solve), submit %.2f ms, other calls %.2f ms",
                  grid, grid, solve, screen, screen, view.longest_fetch, idle_fetch, view.longest_submit,
                  view.longest_other);
    check_that(view.longest_submit < solve && view.longest_other < solve, line, line);
    std::vector<double> &ms = view.replacements;
    std::sort(ms.begin(), ms.end());
    const double median = ms.empty() ? 1e9 : ms[ms.size() / 2];
    std::snprintf(line, sizeof line, "a job is replaced after %.2f ms (median), %.2f ms at most, of %zu", median,
                  ms.empty() ? 1e9 : ms.back(), ms.size());
    /* A machine may be busy with other things: of all, half. */
    check_that(median < solve / 2, line, line);
}

} // namespace

/* The argument is the number of cells per side. */
int main(int count, char **arguments)
{
    const std::uint32_t grid = count > 1 ? std::uint32_t(std::strtoul(arguments[1], nullptr, 10)) : 512;
    sheet_make(&s);
    try {
        const vrtm::Device device = vrtm::Device::create(vrtm::DeviceDesc().set(vrtm::Backend::cpu)).value();
        at(device, grid);
    } catch (const vrtm::Error &error) {
        check_that(0, "no exception", error.what());
    }
    return finish();
}
