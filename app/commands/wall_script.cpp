#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "app/command.h"
#include "app/results.h"
#include "core/text.h"
#include "walls/config/wall_file.h"
#include "walls/config/wall_template.h"
#include "walls/displays/display.h"
#include "walls/link/hosts.h"

namespace hpr {
namespace {

/// What a batch script runs.
struct WallScript {
  std::string wall;              ///< the file, as the job's folder finds it
  std::string scene = {};        ///< empty: named when the script is submitted
  std::string show = "window";   ///< what `hpr display` shows with
  int frames = 0;                ///< 0: until the job is stopped
  std::string time = "1:00:00";  ///< of the job, as Slurm has it
  std::string command = {};      ///< that made it, for the first comment; may be empty
};

constexpr std::string_view kHead = R"(#!/bin/bash
# {name}: {screens} screens on {shown} hosts.{command}
#SBATCH --job-name=hpr-wall
#SBATCH --nodes={nodes}
#SBATCH --nodelist={nodelist}
#SBATCH --ntasks-per-node={most_ranks}
#SBATCH --exclusive
#SBATCH --time={time}
#SBATCH --signal=USR1@60
#SBATCH --output=hpr-wall-%j.log
#SBATCH --open-mode=append
#SBATCH --requeue
##SBATCH --partition=...
##SBATCH --account=...

set -euo pipefail
unset SLURM_NTASKS_PER_NODE  # of the allocation, not of each step
hpr=${{HPR:-hpr}}
wall={wall}
scene={scene}
out=${{HPR_OUT:-$PWD/wall-$SLURM_JOB_ID}}  # where all hosts can write
options=()  # more options of hpr wall run, e.g. (--quality good --target-ms 33)
ranks=({ranks})  # the host of each rank
displays=({displays})  # the hosts that have screens
port=${{HPR_PORT:-$((20000 + SLURM_JOB_ID % 20000))}}  # of the first display; each has its own

# Both ends of a link show that they know it; it is never sent and on no command line.
HPR_TOKEN=$(od -An -N32 -tx1 /dev/urandom | tr -d ' \n')
export HPR_TOKEN

# Shows the screens of a host; started again where it dies before the job is over.
show() {{
  trap 'kill "$step" 2>/dev/null; exit 0' TERM
  while true; do
    srun --overlap --nodes=1 --ntasks=1 --nodelist="$1" --cpu-bind=none --label \
      "$hpr" display --wall "$wall" --host "$1" --listen "0.0.0.0:$2" --show {show} -o "$out/$1" --force &
    step=$!
    wait "$step" || true
    sleep 2
  done
}}

mkdir -p "$out"
addresses=
trap 'kill $(jobs -p) 2>/dev/null || true' EXIT
for host in "${{displays[@]}}"; do
  rm -f "$out/$host/display.json"
  show "$host" "$port" &
  addresses+=${{addresses:+,}}$host=$host:$port
  port=$((port + 1))
done
until=$((SECONDS + 30))
for host in "${{displays[@]}}"; do
  until [[ -e $out/$host/display.json ]]; do
    if ((SECONDS >= until)); then
      echo "no display on $host after 30 s; going on without it" >&2
      break
    fi
    sleep 0.1
  done
done
)";

constexpr std::string_view kRun = R"(
printf '%s\n' "${{ranks[@]}}" >"$out/hosts"
code=0
SLURM_HOSTFILE=$out/hosts "$hpr" wall run "$wall" "$scene" --display remote --displays "$addresses" -o "$out" {length} \
  --ranks {tasks} --launcher "srun --mpi=pmix --kill-on-bad-exit --overlap --cpu-bind=none --distribution=arbitrary \
--nodes={nodes} --ntasks={tasks}" "${{options[@]}}" || code=$?
)";

constexpr std::string_view kRequeue = R"(
# Stopped before its last frame, as Slurm says a minute before the time is up: goes on in the same job, queued again.
# The code is 75 then, unless srun killed ranks that left after the first one: the new manifest knows.
if [[ $code != 0 && $out/manifest.json -nt $out/hosts ]] && grep -q '^  "stopped"' "$out/manifest.json"; then
  scontrol requeue "$SLURM_JOB_ID"
  exit 0
fi
)";

void check_host(const std::string& host) {
  if (!host.empty() && host != "localhost" && host.find_first_of("[],*") == std::string::npos) {
    (void)parse_host_list(host);
    return;
  }
  throw Error(ExitCode::Usage, fmt::format("Slurm does not know a host '{}'", printable(host)),
              "give each node of the wall file its host, and each window its node; see hpr wall init --hosts");
}

/// The host of each rank, in the order of the nodes, as the wall file counts them.
std::vector<std::string> hosts_of_ranks(const Wall& wall) {
  std::vector<std::string> hosts;
  for (const WallNode& node : wall.nodes) {
    check_host(node.host);
    hosts.insert(hosts.end(), static_cast<std::size_t>(std::max(1, node.ranks)), node.host);
  }
  if (hosts.empty()) {
    throw Error(ExitCode::Usage, "the wall has no nodes, so nobody knows on which hosts to run",
                "begin with hpr wall init --hosts LIST");
  }
  return hosts;
}

/// A script for sbatch: a display process on every host with screens, and `hpr wall run` with one task per rank of each
/// node, on its host. Throws Error (Usage) for a wall whose nodes or screens have no hosts Slurm could know.
std::string write_slurm_script(const Wall& wall, const WallScript& script) {
  using fmt::arg;
  const std::vector<std::string> ranks = hosts_of_ranks(wall);
  std::vector<std::string> hosts;
  std::ptrdiff_t most_ranks = 0;
  for (const std::string& host : ranks) {
    if (std::ranges::find(hosts, host) == hosts.end()) hosts.push_back(host);
    most_ranks = std::max(most_ranks, std::ranges::count(ranks, host));
  }
  std::vector<std::string> displays;
  for (const WallHost& host : wall_hosts(wall)) {
    check_host(host.host);
    displays.push_back(host.host);
  }
  const std::string scene =
      script.scene.empty() ? "${1:?name a scene: sbatch SCRIPT SCENE}" : shell_quote(script.scene);
  const std::string made = script.command.empty() ? "" : fmt::format("\n# Made by: {}", printable(script.command, 400));
  std::string text =
      fmt::format(kHead, arg("name", printable(wall.name)), arg("screens", wall.screens.size()),
                  arg("shown", displays.size()), arg("command", made), arg("nodes", hosts.size()),
                  arg("nodelist", fmt::join(hosts, ",")), arg("most_ranks", most_ranks), arg("time", script.time),
                  arg("wall", shell_quote(script.wall)), arg("scene", scene), arg("ranks", fmt::join(ranks, " ")),
                  arg("displays", fmt::join(displays, " ")), arg("show", script.show));
  const std::string length =
      script.frames > 0 ? fmt::format("--frames {} --resume", script.frames) : "--until-stopped --force";
  text += fmt::format(kRun, arg("nodes", hosts.size()), arg("tasks", ranks.size()), arg("length", length));
  if (script.frames > 0) text += kRequeue;
  return text + "exit \"$code\"\n";
}

class WallScriptCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "script"; }
  [[nodiscard]] std::string_view summary() const override { return "a batch script that runs a scene on the wall"; }

  void declare(const OptionSet& options) override {
    options.option("wall", script_.wall, "a wall file whose nodes name hosts").required().type("WALL");
    options.option("scene", script_.scene, "a .gltf or .glb file, or gen:NAME (default: named to sbatch)");
    options.flag("--slurm", slurm_, "for Slurm's sbatch").required();
    options.option("--show", script_.show, "what the display processes show with, see hpr display").show_default();
    options.option("--frames", script_.frames, "how many (default: until the job is stopped)").range(1, 1'000'000);
    options.option("--time", script_.time, "of the job, as Slurm has it").show_default();
    options.option("-o,--output", output_, "instead of standard output").type("FILE");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    WallScript script = script_;
    const bool plain = script.time.find_first_not_of("0123456789:-") == std::string::npos && !script.time.empty();
    if (!plain) {
      throw Error(ExitCode::Usage, fmt::format("--time: '{}' is no time of Slurm's", printable(script.time)),
                  "write e.g. 90 (minutes), 8:00:00 or 2-00:00:00");
    }
    if (find_display(script.show).stream) {
      throw Error(ExitCode::Usage, "the displays of a script have no command to pipe to",
                  "use --show window, web, file or none");
    }
    script.command = "hpr " + shell_line(globals.args);
    const std::string text = write_slurm_script(load_wall(script.wall), script);
    write_or_print(text, output_, globals.force);
    return ExitCode::Done;
  }

 private:
  WallScript script_;
  bool slurm_ = false;
  std::string output_;
};

}  // namespace

/// `hpr wall script WALL [SCENE] --slurm`.
std::unique_ptr<Command> make_wall_script_command() {
  return std::make_unique<WallScriptCommand>();
}

}  // namespace hpr
