#include "gpu/device/gpu_buffer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

/// Kinds of memory in the order of preference. What the CPU reads is quick only where its caches have it.
std::array<VkMemoryPropertyFlags, 2> kinds_of(GpuMemory memory) {
  constexpr VkMemoryPropertyFlags kSeen = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  switch (memory) {
    case GpuMemory::Upload:
      return {kSeen, kSeen};
    case GpuMemory::Readback:
      return {kSeen | VK_MEMORY_PROPERTY_HOST_CACHED_BIT, kSeen};
    case GpuMemory::Device:
      break;
  }
  return {VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0};
}

}  // namespace

GpuBuffer::GpuBuffer(const GpuDevice& device, std::size_t bytes, GpuMemory memory) : device_(&device), bytes_(bytes) {
  const VulkanFunctions& vk = device.vk();
  const std::string doing = fmt::format("allocating {}", format_bytes(bytes_));
  try {
    auto wanted = vulkan_structure<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
    wanted.size = std::max<std::size_t>(bytes_, 4);
    wanted.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                   VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    device.check(vk.CreateBuffer(device.handle(), &wanted, nullptr, &buffer_), doing);
    VkMemoryRequirements needed{};
    vk.GetBufferMemoryRequirements(device.handle(), buffer_, &needed);

    auto flags = vulkan_structure<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
    flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    auto allocation = vulkan_structure<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
    allocation.pNext = &flags;
    allocation.allocationSize = needed.size;
    int type = -1;
    for (const VkMemoryPropertyFlags kind : kinds_of(memory)) {
      if (type < 0) type = device.memory_type(needed.memoryTypeBits, kind);
    }
    if (type < 0 || needed.size > device.heap_bytes(type)) device.check(VK_ERROR_OUT_OF_DEVICE_MEMORY, doing);
    allocation.memoryTypeIndex = static_cast<std::uint32_t>(type);
    device.check(vk.AllocateMemory(device.handle(), &allocation, nullptr, &memory_), doing);
    device.check(vk.BindBufferMemory(device.handle(), buffer_, memory_, 0), doing);
    if (memory != GpuMemory::Device) {
      device.check(vk.MapMemory(device.handle(), memory_, 0, VK_WHOLE_SIZE, 0, &mapped_), doing);
    }
    auto which = vulkan_structure<VkBufferDeviceAddressInfo>(VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO);
    which.buffer = buffer_;
    address_ = vk.GetBufferDeviceAddress(device.handle(), &which);
  } catch (...) {
    release();
    throw;
  }
}

GpuBuffer::GpuBuffer(GpuBuffer&& other) noexcept
    : device_(other.device_),
      bytes_(other.bytes_),
      buffer_(std::exchange(other.buffer_, VkBuffer{})),
      memory_(std::exchange(other.memory_, VkDeviceMemory{})),
      address_(std::exchange(other.address_, 0)),
      mapped_(std::exchange(other.mapped_, nullptr)) {}

GpuBuffer::~GpuBuffer() {
  release();
}

void GpuBuffer::release() {
  if (device_->is_given_up()) return;
  if (buffer_ != VK_NULL_HANDLE) device_->vk().DestroyBuffer(device_->handle(), buffer_, nullptr);
  if (memory_ != VK_NULL_HANDLE) device_->vk().FreeMemory(device_->handle(), memory_, nullptr);
}

}  // namespace hpr
