#pragma once

#define VK_NO_PROTOTYPES
#include <vulkan/vulkan.h>

// The functions of an instance and of a device that hpr calls, without the prefix vk.
#define HPR_VULKAN_INSTANCE_FUNCTIONS(X)    \
  X(DestroyInstance)                        \
  X(EnumeratePhysicalDevices)               \
  X(GetPhysicalDeviceProperties2)           \
  X(GetPhysicalDeviceFeatures2)             \
  X(GetPhysicalDeviceMemoryProperties)      \
  X(GetPhysicalDeviceQueueFamilyProperties) \
  X(CreateDevice)                           \
  X(GetDeviceProcAddr)
#define HPR_VULKAN_DEVICE_FUNCTIONS(X) \
  X(DestroyDevice)                     \
  X(GetDeviceQueue)                    \
  X(QueueSubmit)                       \
  X(AllocateMemory)                    \
  X(FreeMemory)                        \
  X(MapMemory)                         \
  X(CreateBuffer)                      \
  X(DestroyBuffer)                     \
  X(GetBufferMemoryRequirements)       \
  X(BindBufferMemory)                  \
  X(GetBufferDeviceAddress)            \
  X(CreateShaderModule)                \
  X(DestroyShaderModule)               \
  X(CreatePipelineLayout)              \
  X(DestroyPipelineLayout)             \
  X(CreateComputePipelines)            \
  X(DestroyPipeline)                   \
  X(CreateCommandPool)                 \
  X(DestroyCommandPool)                \
  X(ResetCommandPool)                  \
  X(AllocateCommandBuffers)            \
  X(BeginCommandBuffer)                \
  X(EndCommandBuffer)                  \
  X(CmdBindPipeline)                   \
  X(CmdPushConstants)                  \
  X(CmdDispatch)                       \
  X(CmdCopyBuffer)                     \
  X(CmdFillBuffer)                     \
  X(CmdPipelineBarrier)                \
  X(CmdWriteTimestamp)                 \
  X(CmdResetQueryPool)                 \
  X(CreateQueryPool)                   \
  X(DestroyQueryPool)                  \
  X(GetQueryPoolResults)               \
  X(CreateSemaphore)                   \
  X(DestroySemaphore)                  \
  X(WaitSemaphores)

namespace hpr {

/// Vulkan's functions, found at run time: hpr links no libvulkan, so that a machine without it runs all the rest.
struct VulkanFunctions {
  PFN_vkGetInstanceProcAddr GetInstanceProcAddr = nullptr;
  PFN_vkCreateDebugUtilsMessengerEXT CreateDebugUtilsMessengerEXT = nullptr;    ///< null without the extension
  PFN_vkDestroyDebugUtilsMessengerEXT DestroyDebugUtilsMessengerEXT = nullptr;  ///< null without the extension
#define HPR_VULKAN_MEMBER(name) PFN_vk##name name = nullptr;
  HPR_VULKAN_INSTANCE_FUNCTIONS(HPR_VULKAN_MEMBER)
  HPR_VULKAN_DEVICE_FUNCTIONS(HPR_VULKAN_MEMBER)
#undef HPR_VULKAN_MEMBER
};

/// A structure of Vulkan, all 0 but for what it is.
template <typename Structure>
[[nodiscard]] Structure vulkan_structure(VkStructureType type) {
  Structure structure{};
  structure.sType = type;
  return structure;
}

}  // namespace hpr
