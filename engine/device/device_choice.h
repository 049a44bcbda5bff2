#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "gpu/device/gpu_device.h"

namespace hpr {

struct Scene;

/// What a rank can bring to keys and light where it is left open who makes them.
struct DeviceOffer {
  enum class State : std::uint8_t {
    None,     ///< Vulkan has no GPU there
    Lacking,  ///< it has, but kernels need what that has not
    Failed,   ///< a GPU that does not start
    Ready,
  };
  State state = State::None;
  std::string host;
  std::string problem = {};  ///< why it is not ready
};

/// What the devices of a machine offer to a rank of it: GPUs alone, as they are dealt out by local rank.
[[nodiscard]] DeviceOffer offer_of(const std::vector<GpuInfo>& gpus, const std::string& host);

/// Starts a device, which it chooses by the function it is called with; throws Error where it does not start.
using StartGpu = std::function<void(const GpuDevice::Choose&)>;

/// Has `start` start the GPU of a rank, where its host has one. Whatever goes wrong is in the offer.
[[nodiscard]] DeviceOffer start_offered(const std::string& host, int local_rank, const StartGpu& start);

/// Whether devices make keys and light, and why not.
struct DeviceChoice {
  bool uses = false;
  std::string why = {};     ///< why not; empty: nobody has a GPU
  bool is_warning = false;  ///< work is slower than whoever looks at the machine would expect
};

/// Devices are used where all ranks have one that is ready: else parts of one picture would come from devices that
/// round otherwise. In order of rank; equal on all ranks.
[[nodiscard]] DeviceChoice choose_devices(std::span<const DeviceOffer> of_ranks);

/// The device that a rank uses.
struct DeviceOfRank {
  std::string host;
  std::array<std::uint8_t, 16> uuid{};
  bool software = false;
};

/// What to say where ranks of a host have to use a GPU together; empty: each has one of its own.
[[nodiscard]] std::string describe_crowding(std::span<const DeviceOfRank> of_ranks);

/// About how much of a device's memory keys and light of a scene take, in bytes: more, rather than less.
[[nodiscard]] std::uint64_t device_bytes_of(const Scene& scene);

}  // namespace hpr
