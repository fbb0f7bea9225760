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
        drawn += 1;
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
    int refused = 0, drawn = 0;
    bool rises = true;
    std::vector<double> replacements;

private:
    vrtm::Asset asset_;
    vrtm::Tile tile_;
    vrtm::Job job_;
    float last_progress_ = 0;
};

/*
 * Each picture that is drawn while a pose is computed is the one of the last pose that was done; once it is the new one,
 * it stays that.
 */
void draw_until_ready(Viewport &view, const std::vector<Pose> &poses, const std::vector<Picture> &pictures)
{
    std::size_t shown = 0;
    int torn = 0, during = 0;
    for (std::size_t k = 1; k < poses.size(); ++k) {
        view.mouse_moved(poses[k]);
        do {
            during += view.busy();
            const Picture picture = view.draw();
            /* It may be done before the loop hears of it. */
            shown = picture == pictures[k] ? k : shown;
            torn += picture != pictures[shown];
        } while (!view.ready());
        shown = k;
        torn += view.draw() != pictures[shown];
    }
    const std::string drawn = std::to_string(during) + " pictures were drawn during " +
                              std::to_string(poses.size() - 1) + " solves";
    check_that(during >= int(poses.size()), drawn.c_str(), "");
    check_that(view.refused == 0, "no call was refused", "");
    check_that(torn == 0, "each was the last result, bit for bit", std::to_string(torn).c_str());
    check_that(view.rises, "progress never falls", "");
}

/* The mouse moves again before the solve is done, after so many milliseconds. */
void replace_on_the_next_move(Viewport &view, const std::vector<Pose> &poses, const std::vector<Picture> &pictures)
{
    std::size_t shown = 0;
    int torn = 0;
    view.still(poses[0]);
    view.replacements.clear();
    for (int move = 0; move < 40; ++move) {
        const std::size_t next = 1 + std::size_t(move) % (poses.size() - 1);
        const bool busy = view.busy();
        if (!view.mouse_moved(poses[next]) && busy) {
            /* The one before was done in the end. */
            shown = 1 + std::size_t(move - 1) % (poses.size() - 1);
        }
        const Clock::time_point start = Clock::now();
        while (ms_since(start) < 1.5 * (move % 16)) {
            const Picture picture = view.draw();
            shown = picture == pictures[next] ? next : shown;
            torn += picture != pictures[shown];
            std::this_thread::sleep_for(std::chrono::microseconds(500));
        }
        if (view.ready()) {
            shown = next;
        }
    }
    std::vector<double> &ms = view.replacements;
    std::sort(ms.begin(), ms.end());
    if (!check_that(ms.size() > 10, "solves were replaced", std::to_string(ms.size()).c_str())) {
        return;
    }
    check_that(torn == 0 && view.refused == 0, "and the last result was drawn meanwhile", std::to_string(torn).c_str());
    view.mouse_moved(poses[2]);
    while (!view.ready()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    check_that(view.draw() == pictures[2], "the pose that was left alone has its bits", "");
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
    draw_until_ready(view, poses, pictures);
    replace_on_the_next_move(view, poses, pictures);
    char line[400];
    std::snprintf(line, sizeof line,
                  "%u x %u cells, a solve takes %.0f ms: longest fetch of %u x %u texels %.2f ms (%.2f ms without a "
                  "solve), submit %.2f ms, other calls %.2f ms",
                  grid, grid, solve, screen, screen, view.longest_fetch, idle_fetch, view.longest_submit,
                  view.longest_other);
    check_that(view.longest_submit < solve && view.longest_other < solve, line, line);
    const std::vector<double> &ms = view.replacements;
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
