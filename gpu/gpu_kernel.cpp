#include "gpu/gpu_kernel.h"

#include "core/error.h"

namespace hpr {

GpuKernel::GpuKernel(const GpuDevice& device, std::span<const std::uint32_t> spirv, std::size_t constants)
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

}  // namespace hpr
