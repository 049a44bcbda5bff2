#pragma once

#include <cstdint>
#include <optional>

#include "gpu/device/gpu_batch.h"
#include "gpu/device/gpu_buffer.h"
#include "gpu/device/gpu_device.h"
#include "rt/photons/photon_map.h"

namespace hpr {

/// The photon maps of one sample in a device's memory, as shaders read them (gpu/shaders/photons.glsl): at first empty
/// ones. The device must outlive it.
class GpuPhotons {
 public:
  explicit GpuPhotons(const GpuDevice& device);

  /// Copies the maps there in place of those before, which no work may use any more. Memory is kept for the next ones
  /// and grows where they need more. Throws Error (Limit) where the device has not so much left; there are none then.
  void put(const PhotonMaps& maps);

  /// As PhotonMaps of photons.glsl: to be read after each put(). 0: none.
  [[nodiscard]] std::uint64_t address() const { return maps_ ? maps_->address() : 0; }

 private:
  void grow(std::size_t bytes);

  const GpuDevice& device_;
  std::optional<GpuBuffer> staging_;
  std::optional<GpuBuffer> maps_;
  GpuBatch batch_;  ///< after the buffers, which it may still copy when it ends
};

}  // namespace hpr
