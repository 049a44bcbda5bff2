#include "app/options/globals.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "cluster/transport/communicator.h"
#include "compositing/plugin.h"
#include "core/error.h"
#include "core/text.h"
#include "engine/session.h"

namespace hpr {
namespace {

/// CLI11 takes -1 for the largest number.
std::string whole_number_problem(const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (failed == std::errc() && end == text.data() + text.size()) return "";
  return fmt::format("'{}' is no whole number from 0 to 2^64 - 1", printable(text));
}

}  // namespace

std::chrono::nanoseconds parse_time_limit(std::string_view option, const std::string& text, std::string_view example) {
  const auto limit = parse_duration(text);
  if (!limit || *limit <= std::chrono::nanoseconds::zero()) {
    throw Error(ExitCode::Usage, fmt::format("{}: '{}' is no duration", option, printable(text)),
                fmt::format("write e.g. {}", example));
  }
  return *limit;
}

std::chrono::milliseconds to_milliseconds(std::chrono::nanoseconds limit) {
  return std::chrono::ceil<std::chrono::milliseconds>(std::min<std::chrono::nanoseconds>(limit, kMaxWait));
}

void Globals::declare(const OptionSet& options) {
  const std::string everywhere = "Everywhere";
  options
      .flag(
          "-q,--quiet", [this](bool is_set) { verbosity = is_set ? -1 : verbosity; }, "errors only")
      .group(everywhere);
  options.flag("-v,--verbose", verbosity, "say more; twice: from all ranks").group(everywhere);
  options.option("--ranks", ranks, "MPI ranks; hpr starts mpiexec itself")
      .range(1, 4096)
      .last_counts()
      .group(everywhere);
  options.option("--threads", threads, "threads of one rank (default: cores / ranks of a host)")
      .range(1, 1024)
      .group(everywhere);
  options.option("--seed", seed, "of everything random").check(whole_number_problem).show_default().group(everywhere);
  options
      .option("--backend", backend,
              "what draws: OpenGL by egl or osmesa; vulkan, whose devices make keys and light; auto: that with a GPU")
      .show_default()
      .group(everywhere);
  options.option("--device", device, "device of EGL or Vulkan (default: by local rank)")
      .range(0, 1023)
      .group(everywhere);
  options.option("--progress", progress, "auto, bar, line or none")
      .choices({"auto", "bar", "line", "none"})
      .show_default()
      .group(everywhere);
  options.option("--limit-mem", limit_mem, "refuse scenes larger than this, e.g. 4GiB").group(everywhere);
  options.option("--limit-image", limit_image, "refuse pictures larger than this, e.g. 8192x8192").group(everywhere);
  options.option("--hang-timeout", hang_timeout, "longest wait for another rank, e.g. 30s").group(everywhere);
  options
      .option("--launcher", launcher, "what starts the ranks in place of mpiexec, e.g. \"srun --mpi=pmix -n {ranks}\"")
      .type("COMMAND")
      .group(everywhere);
  // Before --strategy gets its value, wherever on the command line that stands.
  options
      .option("--plugin", plugins,
              "a shared object with one more compositing strategy (docs/compositing.md); may be repeated")
      .type("FILE.so")
      .repeats()
      .each([](const std::string& file) { load_compositor_plugin(file); })
      .group(everywhere);
  options.flag("--force", force, "overwrite files").group(everywhere);
  options.option("--trace", trace, "write what ranks and threads did when, as chrome://tracing and Perfetto show it")
      .type("FILE.json")
      .group(everywhere);
}

SceneLimits Globals::scene_limits() const {
  SceneLimits limits;
  if (!limit_mem.empty()) {
    const auto bytes = parse_bytes(limit_mem);
    if (!bytes) throw Error(ExitCode::Usage, fmt::format("--limit-mem: '{}' is no size", limit_mem), "write e.g. 4GiB");
    limits.memory_bytes = *bytes;
    limits.file_bytes = std::min(limits.file_bytes, *bytes);
  }
  if (!limit_image.empty()) {
    const auto extent = parse_extent(limit_image);
    if (!extent)
      throw Error(ExitCode::Usage, fmt::format("--limit-image: '{}' is no size", limit_image), "write e.g. 8192x8192");
    limits.image.side = std::max(extent->first, extent->second);
    limits.image.pixels = static_cast<std::uint64_t>(extent->first) * static_cast<std::uint64_t>(extent->second);
  }
  return limits;
}

ImageLimits Globals::picture_limits() const {
  return limit_image.empty() ? kPictureLimits : scene_limits().image;
}

std::chrono::nanoseconds Globals::hang_limit() const {
  return hang_timeout.empty() ? kHangTimeout : parse_time_limit("--hang-timeout", hang_timeout, "30s");
}

std::optional<std::vector<std::string>> Globals::starter(int count) const {
  if (launcher.empty()) return std::nullopt;
  auto words = split_line(launcher);
  if (!words || words->empty()) {
    throw Error(ExitCode::Usage, fmt::format("--launcher: '{}' is no command", printable(launcher)),
                "write e.g. --launcher \"srun --mpi=pmix -n {ranks}\"");
  }
  constexpr std::string_view kRanks = "{ranks}";
  for (std::string& word : *words) {
    if (const std::size_t at = word.find(kRanks); at != std::string::npos)
      word.replace(at, kRanks.size(), std::to_string(count));
  }
  return words;
}

SessionSettings Globals::session() const {
  return {backend, device, threads};
}

}  // namespace hpr
