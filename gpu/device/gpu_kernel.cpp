#include "gpu/device/gpu_kernel.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "core/error.h"

namespace hpr {

GpuKernel::GpuKernel(const GpuDevice& device, std::span<const std::uint32_t> spirv, std::size_t constants,
                     std::uint32_t variant)
    : device_(device), constants_(constants) {
  HPR_CHECK(constants > 0 && constants <= kMaxKernelConstants && constants % 4 == 0);
  const VulkanFunctions& vk = device.vk();
  VkPushConstantRange range{};
  range.stageFlags = VK_SHADER_STAGE_COMPUTE_BIT;
  range.size = static_cast<std::uint32_t>(constants);
  auto layout = vulkan_structure<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout.pushConstantRangeCount = 1;
  layout.pPushConstantRanges = &range;
  device.check(vk.CreatePipelineLayout(device.handle(), &layout, nullptr, &layout_), "making a kernel");

  auto code = vulkan_structure<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  code.codeSize = spirv.size_bytes();
  code.pCode = spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  VkResult made = vk.CreateShaderModule(device.handle(), &code, nullptr, &module);
  if (made == VK_SUCCESS) {
    auto pipeline = vulkan_structure<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
    pipeline.stage =
        vulkan_structure<VkPipelineShaderStageCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO);
    pipeline.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    pipeline.stage.module = module;
    pipeline.stage.pName = "main";
    const VkSpecializationMapEntry entry{0, 0, sizeof variant};
    const VkSpecializationInfo special{1, &entry, sizeof variant, &variant};
    pipeline.stage.pSpecializationInfo = &special;
    pipeline.layout = layout_;
    made = vk.CreateComputePipelines(device.handle(), VK_NULL_HANDLE, 1, &pipeline, nullptr, &pipeline_);
    vk.DestroyShaderModule(device.handle(), module, nullptr);
  }
  if (made != VK_SUCCESS) vk.DestroyPipelineLayout(device.handle(), layout_, nullptr);
  device.check(made, "making a kernel");
}

GpuKernel::~GpuKernel() {
  if (device_.is_given_up()) return;
  device_.vk().DestroyPipeline(device_.handle(), pipeline_, nullptr);
  device_.vk().DestroyPipelineLayout(device_.handle(), layout_, nullptr);
}

namespace {

/// SPIR-V 1.5, section 3.32: an instruction's number, and its operands.
struct Instruction {
  std::uint32_t code = 0;
  std::span<const std::uint32_t> operands;
};
constexpr std::uint32_t kName = 5;
constexpr std::uint32_t kTypeRuntimeArray = 29;
constexpr std::uint32_t kDecorate = 71;
constexpr std::uint32_t kArrayStride = 6;

std::vector<Instruction> instructions_of(std::span<const std::uint32_t> spirv) {
  constexpr std::size_t kHeader = 5;
  std::vector<Instruction> found;
  for (std::size_t at = kHeader; at < spirv.size();) {
    const std::size_t words = spirv[at] >> 16U;
    HPR_CHECK(words > 0 && at + words <= spirv.size());
    found.push_back({spirv[at] & 0xFFFFU, spirv.subspan(at + 1, words - 1)});
    at += words;
  }
  return found;
}

std::string_view text_of(std::span<const std::uint32_t> words) {
  const auto bytes = std::as_bytes(words);
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): characters are bytes
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return text.substr(0, text.find('\0'));
}

}  // namespace

std::size_t array_stride(std::span<const std::uint32_t> spirv, std::string_view structure) {
  const std::vector<Instruction> all = instructions_of(spirv);
  const auto is_structure = [&](std::uint32_t type) {
    return std::ranges::any_of(all, [&](const Instruction& each) {
      return each.code == kName && each.operands[0] == type && text_of(each.operands.subspan(1)) == structure;
    });
  };
  for (const Instruction& array : all) {
    if (array.code != kTypeRuntimeArray || !is_structure(array.operands[1])) continue;
    for (const Instruction& each : all) {
      if (each.code == kDecorate && each.operands[0] == array.operands[0] && each.operands[1] == kArrayStride) {
        return each.operands[2];
      }
    }
  }
  throw Error(ExitCode::Internal, fmt::format("a shader has no array of {}", structure));
}

}  // namespace hpr
