#include "gpu/device/gpu_batch.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "core/error.h"
#include "core/log.h"
#include "core/timing.h"

namespace hpr {
namespace {

constexpr std::uint32_t kStamps = GpuBatch::kMaxPasses + 1;
constexpr std::uint32_t kMaxGroupsAcross = 65'535;  // every device allows this many

}  // namespace

GpuBatch::GpuBatch(const GpuDevice& device) : device_(device) {
  const VulkanFunctions& vk = device.vk();
  try {
    auto pool = vulkan_structure<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
    pool.queueFamilyIndex = device.queue_family();
    device.check(vk.CreateCommandPool(device.handle(), &pool, nullptr, &pool_), "making a batch");
    auto buffer = vulkan_structure<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
    buffer.commandPool = pool_;
    buffer.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
    buffer.commandBufferCount = 1;
    device.check(vk.AllocateCommandBuffers(device.handle(), &buffer, &commands_), "making a batch");
    auto counts = vulkan_structure<VkSemaphoreTypeCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO);
    counts.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
    auto semaphore = vulkan_structure<VkSemaphoreCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO);
    semaphore.pNext = &counts;
    device.check(vk.CreateSemaphore(device.handle(), &semaphore, nullptr, &semaphore_), "making a batch");
    if (device.timestamp_ns() > 0.0) {
      auto stamps = vulkan_structure<VkQueryPoolCreateInfo>(VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO);
      stamps.queryType = VK_QUERY_TYPE_TIMESTAMP;
      stamps.queryCount = kStamps;
      device.check(vk.CreateQueryPool(device.handle(), &stamps, nullptr, &stamps_), "making a batch");
    }
  } catch (...) {
    release();
    throw;
  }
}

GpuBatch::~GpuBatch() {
  if (in_flight_ && !is_late_) {
    try {
      wait();
    } catch (const Error& error) {
      log::error("{}", error.what());
    }
  }
  if (in_flight_) device_.give_up();
  release();
}

void GpuBatch::release() {
  if (device_.is_given_up()) return;
  const VulkanFunctions& vk = device_.vk();
  if (stamps_ != VK_NULL_HANDLE) vk.DestroyQueryPool(device_.handle(), stamps_, nullptr);
  if (semaphore_ != VK_NULL_HANDLE) vk.DestroySemaphore(device_.handle(), semaphore_, nullptr);
  if (pool_ != VK_NULL_HANDLE) vk.DestroyCommandPool(device_.handle(), pool_, nullptr);
}

void GpuBatch::begin() {
  HPR_CHECK(!in_flight_);
  if (recording_) return;
  const VulkanFunctions& vk = device_.vk();
  device_.check(vk.ResetCommandPool(device_.handle(), pool_, 0), "beginning a batch");
  auto once = vulkan_structure<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  once.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  device_.check(vk.BeginCommandBuffer(commands_, &once), "beginning a batch");
  recording_ = true;
  if (stamps_ != VK_NULL_HANDLE) vk.CmdResetQueryPool(commands_, stamps_, 0, kStamps);
  passes_.clear();
  order();
}

void GpuBatch::order() {
  constexpr VkPipelineStageFlags kWork = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT;
  auto all = vulkan_structure<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  all.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
  all.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
  device_.vk().CmdPipelineBarrier(commands_, kWork | VK_PIPELINE_STAGE_HOST_BIT, kWork | VK_PIPELINE_STAGE_HOST_BIT, 0,
                                  1, &all, 0, nullptr, 0, nullptr);
}

void GpuBatch::stamp() {
  if (stamps_ == VK_NULL_HANDLE) return;
  device_.vk().CmdWriteTimestamp(commands_, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, stamps_,
                                 static_cast<std::uint32_t>(passes_.size()));
}

void GpuBatch::begin_pass(std::string name) {
  begin();
  HPR_CHECK(passes_.size() < kMaxPasses);
  stamp();
  passes_.push_back(std::move(name));
}

void GpuBatch::run(const GpuKernel& kernel, std::uint64_t threads, std::span<const std::byte> constants) {
  HPR_CHECK(constants.size() == kernel.constants());
  const std::uint64_t groups = (threads + kGroupThreads - 1) / kGroupThreads;
  if (groups == 0) return;
  begin();
  const auto across = static_cast<std::uint32_t>(std::min<std::uint64_t>(groups, kMaxGroupsAcross));
  const std::uint64_t down = (groups + across - 1) / across;
  HPR_CHECK(down <= kMaxGroupsAcross);
  const VulkanFunctions& vk = device_.vk();
  vk.CmdBindPipeline(commands_, VK_PIPELINE_BIND_POINT_COMPUTE, kernel.pipeline());
  vk.CmdPushConstants(commands_, kernel.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0,
                      static_cast<std::uint32_t>(constants.size()), constants.data());
  vk.CmdDispatch(commands_, across, static_cast<std::uint32_t>(down), 1);
  order();
}

void GpuBatch::copy(const GpuBuffer& from, const GpuBuffer& to, std::size_t bytes) {
  HPR_CHECK(bytes <= from.bytes() && bytes <= to.bytes());
  if (bytes == 0) return;
  begin();
  VkBufferCopy part{};
  part.size = bytes;
  device_.vk().CmdCopyBuffer(commands_, from.handle(), to.handle(), 1, &part);
  order();
}

void GpuBatch::fill(const GpuBuffer& buffer, std::uint32_t word) {
  HPR_CHECK(buffer.bytes() % 4 == 0);
  if (buffer.bytes() == 0) return;
  begin();
  device_.vk().CmdFillBuffer(commands_, buffer.handle(), 0, buffer.bytes(), word);
  order();
}

void GpuBatch::submit() {
  begin();
  if (!passes_.empty()) stamp();
  const VulkanFunctions& vk = device_.vk();
  recording_ = false;
  device_.check(vk.EndCommandBuffer(commands_), "ending a batch");
  const std::uint64_t done = submitted_ + 1;
  auto counts = vulkan_structure<VkTimelineSemaphoreSubmitInfo>(VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO);
  counts.signalSemaphoreValueCount = 1;
  counts.pSignalSemaphoreValues = &done;
  auto work = vulkan_structure<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  work.pNext = &counts;
  work.commandBufferCount = 1;
  work.pCommandBuffers = &commands_;
  work.signalSemaphoreCount = 1;
  work.pSignalSemaphores = &semaphore_;
  device_.check(vk.QueueSubmit(device_.queue(), 1, &work, VK_NULL_HANDLE), "submitting a batch");
  submitted_ = done;
  submitted_ns_ = trace::now_ns();
  in_flight_ = true;
}

void GpuBatch::wait(int limits) {
  if (!in_flight_) return;
  auto until = vulkan_structure<VkSemaphoreWaitInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO);
  until.semaphoreCount = 1;
  until.pSemaphores = &semaphore_;
  until.pValues = &submitted_;
  const auto limit = static_cast<std::uint64_t>(std::chrono::nanoseconds(limits * device_.limit()).count());
  const VkResult result = device_.vk().WaitSemaphores(device_.handle(), &until, limit);
  is_late_ = result == VK_TIMEOUT;
  in_flight_ = result == VK_TIMEOUT;
  device_.check(result, "computing", limits);
  read_times();
  trace_times();
}

/// The passes as they follow one another up to now, when the device was found to be done; at least after they were
/// submitted, as the clocks differ. All as one where it has no clock.
void GpuBatch::trace_times() const {
  if (!trace::recording()) return;
  const std::int64_t now = trace::now_ns();
  if (times_.empty()) return trace::add_device_span("device", submitted_ns_, now);
  double all_ms = 0.0;
  for (const GpuPassTime& time : times_) all_ms += time.ms;
  const double waited_ms = 1e-6 * static_cast<double>(now - submitted_ns_);
  const double scale = all_ms > waited_ms ? waited_ms / all_ms : 1.0;
  double before_end_ms = scale * all_ms;
  const auto at = [&] { return now - static_cast<std::int64_t>(1e6 * std::max(before_end_ms, 0.0)); };
  for (const GpuPassTime& time : times_) {
    const std::int64_t begin = at();
    before_end_ms -= scale * time.ms;
    trace::add_device_span(time.pass, begin, at());
  }
}

void GpuBatch::read_times() {
  times_.clear();
  if (stamps_ == VK_NULL_HANDLE || passes_.empty()) return;
  std::array<std::uint64_t, kStamps> ticks{};
  const std::size_t count = passes_.size() + 1;
  device_.check(device_.vk().GetQueryPoolResults(device_.handle(), stamps_, 0, static_cast<std::uint32_t>(count),
                                                 count * sizeof(std::uint64_t), ticks.data(), sizeof(std::uint64_t),
                                                 VK_QUERY_RESULT_64_BIT),
                "reading its clock");
  for (std::size_t i = 0; i < passes_.size(); ++i) {
    const auto elapsed = static_cast<double>((ticks.at(i + 1) - ticks.at(i)) & device_.timestamp_mask());
    times_.push_back({passes_[i], 1e-6 * device_.timestamp_ns() * elapsed});
  }
}

}  // namespace hpr
