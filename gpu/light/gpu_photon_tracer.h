#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gpu/device/gpu_buffer.h"
#include "gpu/device/gpu_device.h"
#include "gpu/light/gpu_steps.h"
#include "rt/photons/photon_tracer.h"
#include "scene/scene.h"

namespace hpr {

/// Addresses of what photons are traced through, as light_state.glsl has them.
struct GpuPhotonInputs {
  std::uint64_t scene = 0;
  std::uint64_t surfaces = 0;
  std::uint64_t materials = 0;
  std::uint64_t lights = 0;
};

/// Traces photons on a device, one thread a photon (gpu/shaders/photon_*.comp), by the CPU's steps and random numbers:
/// photons are those of PhotonTracer but for rounding, and have equal bits on devices of one kind.
class GpuPhotonTracer final : public PhotonDevice {
 public:
  /// What `inputs` point to must outlive this, and so must the device. `extended`: some material has extensions.
  GpuPhotonTracer(const GpuDevice& device, const GpuPhotonInputs& inputs, bool extended);

  [[nodiscard]] std::uint64_t max_photons() const override { return photons_; }
  [[nodiscard]] DevicePhotons trace(const PhotonsToTrace& wanted) override;
  [[nodiscard]] std::vector<PassTime> take_times() override;

 private:
  struct Piece;

  void grow();
  void write_input(const PhotonsToTrace& wanted);
  void read_rounds(std::size_t rounds, Piece& piece) const;

  const GpuDevice& device_;
  GpuPhotonInputs inputs_;
  std::size_t state_bytes_ = 0;   ///< of a photon while it is traced
  std::size_t flight_bytes_ = 0;  ///< of one of its flights
  std::size_t photons_ = 0;       ///< traced at once
  GpuBuffer input_;
  std::optional<GpuBuffer> states_;
  std::optional<GpuBuffer> flights_;
  std::optional<GpuBuffer> live_;
  std::optional<GpuBuffer> kept_;
  std::optional<GpuBuffer> read_;
  std::optional<GpuBuffer> statuses_;
  GpuSteps steps_;
};

/// Why a device leaves the photons of a scene to the CPU; empty: it does not.
[[nodiscard]] std::string refusal_of_photons(const Scene& scene);

}  // namespace hpr
