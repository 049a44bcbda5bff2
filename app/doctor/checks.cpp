#include <fmt/format.h>
#include <netdb.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>

#include "app/doctor/doctor.h"
#include "app/launch/launcher.h"
#include "app/launch/run_ranks.h"
#include "cluster/transport/collectives.h"
#include "cluster/transport/mpi_communicator.h"
#include "core/error.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/parallel.h"
#include "core/text.h"
#include "core/timing.h"
#include "gpu/device/gpu_device.h"
#include "image/image_io.h"
#include "raster/gl_context.h"
#include "raster/keys/key_readback.h"
#include "rt/trace/embree_compat.h"

namespace hpr {
namespace {

constexpr double kMiB = 1024.0 * 1024.0;
constexpr double kGiB = 1024.0 * kMiB;

Finding ok(std::string detail) {
  return {{}, FindingStatus::Ok, std::move(detail), {}};
}
Finding warn(std::string detail, std::string remedy) {
  return {{}, FindingStatus::Warn, std::move(detail), std::move(remedy)};
}

/// The value behind "key:" in a file of /proc, without leading blanks.
std::string proc_value(const char* path, std::string_view key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t value = line.find_first_not_of(" \t:", key.size());
    return value == std::string::npos ? std::string() : line.substr(value);
  }
  return {};
}

std::string cpu_model() {
  return proc_value("/proc/cpuinfo", "model name");
}

Finding check_cpu() {
  const std::string model = cpu_model();
  const int cores = job_cores();
  const bool avx2 = __builtin_cpu_supports("avx2") != 0;
  const char* const isa = __builtin_cpu_supports("avx512f") != 0 ? "AVX-512" : avx2 ? "AVX2" : "SSE";
  std::string detail =
      fmt::format("{} usable cores, {}, {}", cores, isa, model.empty() ? "unknown model" : printable(model));
  if (avx2) return ok(std::move(detail));
  return warn(std::move(detail), "without AVX2 rays are slow, and pictures differ from those of machines that have it");
}

/// Bytes this process may use: what the machine has free, or less when a container says so.
Finding check_memory() {
  const std::string text = proc_value("/proc/meminfo", "MemAvailable");
  double bytes = std::strtod(text.c_str(), nullptr) * 1024.0;
  std::string where = "available";
  std::ifstream group("/sys/fs/cgroup/memory.max");
  double limit = 0.0;
  if (group >> limit && limit > 0.0 && limit < bytes) {
    bytes = limit;
    where = "allowed to this container";
  }
  std::string detail = fmt::format("{:.1f} GiB {}", bytes / kGiB, where);
  if (bytes >= 2.0 * kGiB) return ok(std::move(detail));
  return warn(std::move(detail), "run fewer ranks, or smaller scenes and frames");
}

Finding check_embree() {
  auto* const device = rtcNewDevice(nullptr);
  if (device == nullptr) {
    return {{}, FindingStatus::Fail, "Embree opens no device", "apt-get install --reinstall libembree3-3"};
  }
  const auto version = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION);
  const bool wide = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
  const bool half = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0;
  rtcReleaseDevice(device);
  return ok(fmt::format("{}.{}.{}, native packets of {}", version / 10000, version / 100 % 100, version % 100,
                        wide   ? 16
                        : half ? 8
                               : 4));
}

/// The first line `command` prints, without what follows a line break; empty when it fails.
std::string first_line_of(const std::string& command) {
  const auto close = [](FILE* pipe) { ::pclose(pipe); };
  const std::unique_ptr<FILE, decltype(close)> pipe(::popen(command.c_str(), "r"), close);
  std::array<char, 256> line{};
  if (pipe == nullptr || std::fgets(line.data(), static_cast<int>(line.size()), pipe.get()) == nullptr) return {};
  std::string text(line.data());
  text.erase(text.find_last_not_of("\r\n ") + 1);
  return printable(text);
}

Finding check_mpi() {
  constexpr const char* kInstall = "apt-get install openmpi-bin";
  const auto launcher = find_on_path("mpiexec");
  if (!launcher) return warn("mpiexec is not on PATH: only one rank can run", kInstall);
  // The launcher is named without its folder, so that nothing in a path can be taken for shell syntax.
  const std::string version = first_line_of("mpiexec --version 2>/dev/null");
  if (version.empty()) {
    return warn(fmt::format("{} does not say its version: only one rank can run", launcher->string()), kInstall);
  }
  return ok(fmt::format("{} ({})", version, launcher->string()));
}

/// Open MPI keeps the messages of ranks on one host in `folder`.
Finding check_space(const std::string& folder, double needed_bytes, const char* remedy) {
  struct statvfs space {};
  if (::statvfs(folder.c_str(), &space) != 0)
    return warn(fmt::format("{}: {}", printable(folder), std::generic_category().message(errno)), remedy);
  const double free_bytes = static_cast<double>(space.f_bavail) * static_cast<double>(space.f_frsize);
  std::string detail = fmt::format("{}: {:.0f} MiB free", printable(folder), free_bytes / kMiB);
  if (::access(folder.c_str(), W_OK) != 0) return warn(detail + ", but not writable", remedy);
  return free_bytes >= needed_bytes ? ok(std::move(detail)) : warn(std::move(detail), remedy);
}

Finding check_host_name() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) return warn("this host has no name", "set one by hostname(1)");
  const std::string shown = printable(name.data());
  const Stopwatch watch;
  addrinfo* found = nullptr;
  const int failure = ::getaddrinfo(name.data(), nullptr, nullptr, &found);
  if (found != nullptr) ::freeaddrinfo(found);
  if (failure == 0) return ok(fmt::format("{} resolves in {:.1f} ms", shown, watch.ms()));
  return warn(
      fmt::format("{} does not resolve ({}): every MPI job waits seconds at its start", shown, ::gai_strerror(failure)),
      fmt::format("echo '127.0.1.1 {}' >> /etc/hosts", shown));
}

Finding check_image_module() {
  constexpr std::string_view kPicture = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x80\x80\x81";
  const Stopwatch watch;
  const FloatImage image = decode_float_image(std::as_bytes(std::span(kPicture)), "a test picture", {});
  if (image.size != Size{1, 1} || !(std::abs(image.values.front() - 1.0F) < 0.01F)) {
    return {{},
            FindingStatus::Fail,
            "OpenImageIO does not return the pixel of a Radiance picture",
            "apt-get install --reinstall libopenimageio2.4"};
  }
  return ok(
      fmt::format("PNG, JPEG, WebP and EXR are built in; OpenImageIO, for Radiance, opens in {:.0f} ms", watch.ms()));
}

Finding check_stack() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_STACK, &limit) != 0) return warn("the limit cannot be read", "ulimit -s 8192");
  if (limit.rlim_cur == RLIM_INFINITY) return ok("unlimited");
  std::string detail = fmt::format("{:.1f} MiB", static_cast<double>(limit.rlim_cur) / kMiB);
  return static_cast<double>(limit.rlim_cur) >= 4.0 * kMiB ? ok(std::move(detail))
                                                           : warn(std::move(detail), "ulimit -s 8192");
}

constexpr const char* kJobVariable = "HPR_DOCTOR_JOB";
constexpr int kJobRanks = 2;

/// What the job prints once its ranks have exchanged messages.
constexpr std::string_view kJobRuns = "ranks have met";

Finding start_job() {
  if (inside_mpi_job()) return ok("this is a rank of one");
  std::string said;
  const Stopwatch watch;
  try {
    const int code = run_job(
        kJobRanks, {"doctor"},
        {.captured_stdout = &said, .environment = {{kJobVariable, "1"}}, .hang_limit = std::chrono::seconds(10)});
    if (code == 0 && said.find(kJobRuns) != std::string::npos)
      return ok(fmt::format("{} ranks start, meet and end in {:.1f} s", kJobRanks, 1e-3 * watch.ms()));
    return warn(fmt::format("a job of {} ranks left with {}: only one rank can run", kJobRanks, code),
                "see what it says by: hpr demo --ranks 2");
  } catch (const Error& error) {
    return warn(fmt::format("{}: only one rank can run", error.what()), error.hint());
  }
}

}  // namespace

Check job_check() {
  return {"MPI job", start_job};
}

bool is_doctors_job() {
  return inside_mpi_job() && std::getenv(kJobVariable) != nullptr;  // NOLINT(concurrency-mt-unsafe): nobody writes it
}

ExitCode run_doctors_job(const Globals& globals) {
  return run_ranks(globals, [](Communicator& comm) {
    barrier(comm);
    if (comm.rank() == 0 && comm.size() == kJobRanks) fmt::print("{}\n", kJobRuns);
    return ExitCode::Done;
  });
}

std::vector<Check> machine_checks() {
  return {
      {"CPU", check_cpu},
      {"memory", check_memory},
      {"Embree", check_embree},
      {"MPI", check_mpi},
      {"shared memory",
       [] { return check_space("/dev/shm", 256.0 * kMiB, "in a container: docker run --shm-size=1g ..."); }},
      {"temporary files",
       [] {
         return check_space(temporary_folder().string(), 64.0 * kMiB,
                            "free some space, or set TMPDIR to a folder that can be written");
       }},
      {"host name", check_host_name},
      {"pictures", check_image_module},
      {"stack", check_stack},
  };
}

namespace {

Finding try_backend(const std::string& backend) {
  try {
    const auto context = make_gl_context({.backend = backend, .device = -1, .local_rank = 0, .threads = 1});
    return {backend, FindingStatus::Ok,
            fmt::format("{}, keys read by {}{}", context->description(), route_name(fastest_route(*context)),
                        context->software() ? " (software: pictures are right, frames are slow)" : ""),
            ""};
  } catch (const Error& error) {
    return {backend, FindingStatus::Warn, error.what(), error.hint()};
  }
}

/// One finding for all: hpr draws without any.
Finding list_gpus() {
  Finding finding;
  try {
    for (const GpuInfo& gpu : find_gpus()) finding.devices.push_back(judge(gpu));
  } catch (const Error& error) {
    return warn(error.what(), error.hint());
  }
  const auto by = [&](std::string_view backend) {
    return std::ranges::count(finding.devices, backend, &DeviceFinding::backend);
  };
  finding.detail = fmt::format("{} device{}, {}", finding.devices.size(), finding.devices.size() == 1 ? "" : "s",
                               by("auto") > 0     ? "keys and light are made by a GPU"
                               : by("vulkan") > 0 ? "no GPU for keys and light: they are made without, unless asked for"
                                                  : "none that hpr can use");
  if (by("auto") + by("vulkan") == 0) {
    finding.status = FindingStatus::Warn;
    finding.remedy = "install the driver of the GPU, or mesa-vulkan-drivers";
  }
  return finding;
}

/// One backend is enough; without any nothing can be drawn.
Finding any_backend() {
  const auto context = make_gl_context({.backend = "auto", .device = -1, .local_rank = 0, .threads = 1});
  return {"OpenGL", FindingStatus::Ok, fmt::format("--backend auto takes {}", context->name()), ""};
}

}  // namespace

DeviceFinding judge(const GpuInfo& gpu) {
  DeviceFinding device{gpu.index, printable(gpu.name), printable(gpu.driver), gpu.memory, gpu.software, {}, {}, {}};
  if (!gpu.lacks.empty()) {
    device.why = "lacks " + gpu.lacks;
    return device;
  }
  device.use = {"keys", "light"};
  device.backend = gpu.software ? "vulkan" : "auto";
  if (gpu.software) device.why = "software: the CPU does its work, slowly";
  return device;
}

std::vector<Check> graphics_checks() {
  std::vector<Check> checks;
  for (const std::string& backend : all_gl_backends()) {
    checks.push_back({fmt::format("OpenGL by {}", backend), [backend] { return try_backend(backend); }});
  }
  checks.push_back({"OpenGL", any_backend});
  checks.push_back({"Vulkan", list_gpus});
  return checks;
}

int job_cores() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  if (::sched_getaffinity(0, sizeof(cores), &cores) != 0) return usable_cores();
  if (inside_mpi_job()) {
    // Whoever started this rank is mostly free to use what the whole job may; a script between may not be.
    cpu_set_t launcher;
    CPU_ZERO(&launcher);
    if (::sched_getaffinity(::getppid(), sizeof(launcher), &launcher) == 0) CPU_OR(&cores, &cores, &launcher);
  }
  return CPU_COUNT(&cores);
}

Machine this_machine() {
  const std::string model = cpu_model();
  return {model.empty() ? "unknown" : model, job_cores(), mpi_version()};
}

}  // namespace hpr
