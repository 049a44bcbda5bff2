#include "app/bench_command.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <nlohmann/json.hpp>

#include "app/bench_net.h"
#include "app/bench_raster.h"
#include "app/launcher.h"
#include "app/machine.h"
#include "core/parallel.h"
#include "raster/gl_context.h"

namespace hpr {
namespace {

/// Our figure beside the floor's or a peer's, as a ratio of speeds: 1 is equal, more is faster (docs/cli.md).
class BenchCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "bench"; }
  [[nodiscard]] std::string_view summary() const override {
    return "our speed beside a floor's or a peer's, as ratios";
  }

  void declare(CLI::App& app) override {
    app.require_subcommand(1);
    CLI::App* const raster =
        app.add_subcommand("raster", "a frame with raster only against a bare GL loop of the same mesh and readback");
    net_ = app.add_subcommand("net", "messages, merging and copying between two ranks, against plain MPI and a copy");
    for (CLI::App* const bench : {raster, net_}) {
      bench->add_flag("--json", json_, "one JSON document");
      bench->fallthrough();
    }
  }

  [[nodiscard]] bool collective() const override { return net_->parsed(); }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    return net_->parsed() ? run_net(globals) : run_raster(globals);
  }

 private:
  [[nodiscard]] ExitCode run_raster(const Globals& globals) const {
    const int threads = globals.threads > 0 ? globals.threads : usable_cores();
    const auto context =
        make_gl_context({.backend = globals.backend, .device = globals.device, .local_rank = 0, .threads = threads});
    print(bench_raster(*context, threads), context->description());
    return ExitCode::Done;
  }

  [[nodiscard]] ExitCode run_net(const Globals& globals) const {
    Globals pair = globals;
    if (pair.ranks == 0 && !inside_mpi_job()) pair.ranks = 2;
    if (pair.ranks == 1)
      throw Error(ExitCode::Usage, "bench net needs two ranks", "leave --ranks out, or say --ranks 2");
    return run_ranks(pair, [&](Communicator& comm) {
      if (comm.size() < 2) throw Error(ExitCode::Usage, "bench net needs two ranks", "mpirun -n 2 hpr bench net");
      const std::vector<BenchRow> rows = bench_net(comm);
      if (comm.rank() == 0) print(rows, this_machine().cpu);
      return ExitCode::Done;
    });
  }

  void print(const std::vector<BenchRow>& rows, const std::string& machine) const {
    if (!json_) {
      fmt::print("{:<44} {:>10} {:>10} {:<6} {:>6}\n", "", "ours", "floor", "", "ratio");
      for (const BenchRow& row : rows) {
        fmt::print("{:<44} {:>10.2f} {:>10.2f} {:<6} {:>6.2f}\n", row.name, row.ours, row.floor, row.unit, row.ratio);
      }
      return;
    }
    nlohmann::ordered_json json{
        {"schema", "hpr.bench/1"}, {"machine", machine}, {"commit", kCommit}, {"rows", nlohmann::json::array()}};
    for (const BenchRow& row : rows) {
      json["rows"].push_back(
          {{"name", row.name}, {"ours", row.ours}, {"floor", row.floor}, {"unit", row.unit}, {"ratio", row.ratio}});
    }
    fmt::print("{}\n", json.dump(2));
  }

  CLI::App* net_ = nullptr;
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> make_bench_command() {
  return std::make_unique<BenchCommand>();
}

}  // namespace hpr
