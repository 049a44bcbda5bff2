#include "gpu/light/gpu_steps.h"

#include <algorithm>
#include <string>

#include "core/job_board.h"

namespace hpr {
namespace {

/// As light_state.glsl and photon_state.glsl have them.
struct Constants {
  std::uint64_t input;
  std::uint32_t count;
  std::uint32_t round;
};

}  // namespace

GpuSteps::GpuSteps(const GpuDevice& device, std::span<const GpuStep> steps, const GpuStepTraits& traits)
    : input_(traits.input), batch_(device) {
  for (const GpuStep& step : steps) {
    const auto shader = traits.extended ? step.shader : step.plain_shader;
    const bool runs = !step.pass || runs_pass(traits.plan, *step.pass);
    kernels_.push_back(runs ? &device.kernel(shader, sizeof(Constants), traits.variant) : nullptr);
    times_.push_back({std::string(step.name), 0.0, step.pass});
  }
  if (!device.info().software) return;
  for (const GpuKernel* kernel : kernels_) {
    if (kernel != nullptr) batch_.compile(*kernel, Constants{input_, 0, 0});
  }
}

void GpuSteps::run(std::size_t step, std::size_t threads, std::size_t count, std::uint32_t round) {
  if (kernels_[step] == nullptr) return;
  batch_.begin_pass(times_[step].name);
  batch_.run(*kernels_[step], threads, Constants{input_, static_cast<std::uint32_t>(count), round});
}

void GpuSteps::finish() {
  batch_.submit();
  batch_.wait();
  report_step();
  for (const GpuPassTime& time : batch_.times()) {
    const auto step = std::ranges::find(times_, time.pass, &PassTime::name);
    if (step != times_.end()) step->ms += time.ms;
  }
}

void GpuSteps::clear_times() {
  for (PassTime& step : times_) step.ms = 0.0;
}

}  // namespace hpr
