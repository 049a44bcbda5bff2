#include "tools/bench/bench_scale.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <set>

#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/json.h"
#include "core/progress.h"
#include "engine/checkpoint.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/session.h"
#include "engine/wall/wall_displays.h"
#include "rt/deferred_shader.h"
#include "tools/bench/bench_times.h"
#include "tools/report/lists.h"
#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// A wall on its way through one job.
class WallBench {
 public:
  /// Collective.
  WallBench(Session& session, const ScaleInput& input, Size grid, const std::vector<std::string>& hosts)
      : session_(session), input_(input), sampling_(input.settings.sampling) {
    const Wall wall = load_wall(wall_of(grid, input.size));
    const Scene& scene = session.scene();
    const std::vector<View> screens = wall_views(wall, choose_camera(input.settings.camera, scene), scene.bounds);
    const FrameSettings& settings = input.settings.frame;
    blocks_ = cut_blocks(at_resolution(screens, settings.resolution_scale));
    showing_.exposure_stops = input.settings.exposure_stops;
    showing_.shown_by = owners_of(wall, hosts, false);
    for (const View& screen : screens) showing_.sizes.push_back(screen.screen);
    plan_ = plan_frame(session, settings, blocks_.views);
    prepare(session, plan_);
    run_.grid = grid;
    run_.ranks = session.comm().size();
    run_.threads = session.threads();
    run_.hosts = static_cast<int>(std::set<std::string>(hosts.begin(), hosts.end()).size());
  }

  /// Collective. On rank 0 what was measured.
  [[nodiscard]] ScaleRun draw(int frames) {
    std::vector<std::vector<double>> of_ranks(static_cast<std::size_t>(run_.ranks));
    for (int frame = -input_.warmup; frame < frames; ++frame) {
      const Times mine = draw_one();
      const std::vector<Times> all = all_gather_value(session_.comm(), mine);
      if (frame < 0) continue;
      run_.ms.push_back(std::ranges::max(all, {}, &Times::shown_ms).shown_ms);
      run_.bytes_sent = 0;
      for (std::size_t rank = 0; rank < all.size(); ++rank) {
        of_ranks[rank].push_back(all[rank].busy_ms);
        run_.bytes_sent += all[rank].bytes;
      }
    }
    for (std::vector<double>& times : of_ranks) run_.rank_ms.push_back(median(std::move(times)));
    run_.frame_xxh64 = hash_of_screens();
    return run_;
  }

 private:
  struct Times {
    double busy_ms = 0.0;
    double shown_ms = 0.0;
    std::uint64_t bytes = 0;
  };

  Times draw_one() {
    CountingCommunicator& comm = session_.comm();
    session_.shader(plan_.rays).discard_photons();  // of the same sample, in the frame before
    barrier(comm);
    const std::size_t bytes_before = comm.bytes_sent();
    const double start = comm.seconds();
    Progress silent("none", "sample", 0);
    FrameSampler sampler(session_, plan_, sampling_, 0, false);
    (void)sampler.draw(blocks_.views, {}, silent);  // it stops before its goal for a checkpoint only
    double busy = sampler.times().primary_ms;
    for (const PassTime& pass : sampler.times().passes) busy += pass.ms / session_.threads();
    screens_ = bring_to_screens(session_, sampler.frame(), blocks_, showing_);
    return {busy, (comm.seconds() - start) * 1e3, comm.bytes_sent() - bytes_before};
  }

  /// Collective.
  std::string hash_of_screens() {
    std::vector<std::uint64_t> hashes;
    for (std::size_t screen = 0; screen < showing_.sizes.size(); ++screen) {
      const std::uint64_t mine = xxh64(std::as_bytes(screens_[screen].pixels()));
      const auto all = all_gather_value(session_.comm(), mine);
      hashes.push_back(all.at(static_cast<std::size_t>(showing_.shown_by[screen])));
    }
    return hex16(hashes.size() == 1 ? hashes.front() : xxh64(std::as_bytes(std::span(hashes))));
  }

  Session& session_;
  const ScaleInput& input_;
  Sampling sampling_;
  Showing showing_;
  Blocks blocks_;
  FramePlan plan_;
  std::vector<Image<Rgba8>> screens_;
  ScaleRun run_;
};

ScaleRun run_from(const Json& json) {
  ScaleRun run;
  run.grid = {json.at("columns").get<int>(), json.at("rows").get<int>()};
  run.ranks = json.at("ranks").get<int>();
  run.threads = json.at("threads").get<int>();
  run.hosts = json.at("hosts").get<int>();
  run.ms = json.at("ms").get<std::vector<double>>();
  run.rank_ms = json.at("rank_ms").get<std::vector<double>>();
  run.bytes_sent = json.at("bytes_sent").get<std::uint64_t>();
  run.frame_xxh64 = json.at("frame_xxh64").get<std::string>();
  return run;
}

}  // namespace

std::vector<ScaleRun> measure_scale(Communicator& comm, const Globals& globals, const ScaleInput& input, int frames) {
  HPR_CHECK(frames > 0);
  Session session(comm, globals.session(), [&] { return load_scene(input.scene, input.settings, globals); });
  const std::vector<std::string> hosts = all_gather_texts(comm, session.host());
  std::vector<ScaleRun> runs;
  for (const Size grid : input.grids) {
    runs.push_back(WallBench(session, input, grid, hosts).draw(frames));
  }
  if (comm.rank() != 0) runs.clear();
  return runs;
}

std::string scale_runs_to_json(const std::vector<ScaleRun>& runs) {
  Json json = Json::array();
  for (const ScaleRun& run : runs) {
    json.push_back({{"columns", run.grid.width},
                    {"rows", run.grid.height},
                    {"ranks", run.ranks},
                    {"threads", run.threads},
                    {"hosts", run.hosts},
                    {"ms", run.ms},
                    {"rank_ms", run.rank_ms},
                    {"bytes_sent", run.bytes_sent},
                    {"frame_xxh64", run.frame_xxh64}});
  }
  return json.dump() + "\n";
}

std::vector<ScaleRun> scale_runs_from_json(std::string_view text) {
  try {
    std::vector<ScaleRun> runs;
    const Json list = Json::parse(text);
    for (const Json& run : list.elements()) runs.push_back(run_from(run));
    return runs;
  } catch (const JsonError& failure) {
    throw Error(ExitCode::Internal, fmt::format("an MPI job did not hand over its runs: {}", failure.what()));
  }
}

void append_frames(std::vector<ScaleRun>& runs, std::vector<ScaleRun> more) {
  if (runs.empty()) {
    runs = std::move(more);
    return;
  }
  HPR_CHECK(runs.size() == more.size());
  for (std::size_t i = 0; i < runs.size(); ++i) {
    runs[i].ms.insert(runs[i].ms.end(), more[i].ms.begin(), more[i].ms.end());
    // The middle of jobs' medians would need all of them; the quickest job was disturbed least.
    std::ranges::transform(runs[i].rank_ms, more[i].rank_ms, runs[i].rank_ms.begin(),
                           [](double a, double b) { return std::min(a, b); });
    if (runs[i].frame_xxh64 != more[i].frame_xxh64) runs[i].frame_xxh64 = kDiffering;
  }
}

}  // namespace hpr
