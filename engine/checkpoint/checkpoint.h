#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "engine/frame_settings.h"

namespace hpr {

class Film;
class Session;
struct FramePlan;
struct RenderSettings;
struct SampleProgress;
struct View;

/// Names and values of everything that decides the bits of a picture, but for the number of samples. How the work is
/// spread over ranks and threads is not among them.
using RunIdentity = std::vector<std::pair<std::string, std::string>>;

/// Where a run's sums go when it is stopped, and what it is.
struct CheckpointSettings {
  std::filesystem::path path;             ///< empty: none is written
  bool resume = false;                    ///< begin with what stands there
  std::function<RunIdentity()> identity;  ///< called when it is needed: it hashes the whole scene
  bool at_end = false;                    ///< also when the goal is reached, for a later run that wants more
  bool takes_more = false;                ///< a checkpoint with more samples than the goal is accepted
  std::chrono::nanoseconds every{0};      ///< how often one is written unasked; 0: never
  bool keeps_previous = false;            ///< see CheckpointFile
};

/// A file that is no whole checkpoint: cut short, damaged, or no checkpoint at all.
class DamagedCheckpoint : public Error {
 public:
  using Error::Error;
};

/// A film that holds all tiles of its frame, and how far it has come, as a file: a versioned header, whether the user
/// asked for it, the identity, the counters, every layer's active tiles, and the XXH64 of all that.
[[nodiscard]] std::vector<std::byte> encode_checkpoint(const RunIdentity& identity, Film& film,
                                                       const SampleProgress& progress, bool asked_for = true);

/// Throws DamagedCheckpoint unless `bytes` are a whole checkpoint, and Error (BadInput) where that is of another
/// format.
void check_whole(std::span<const std::byte> bytes, const std::string& name);

/// Whether the user asked for this checkpoint. Throws as check_whole().
[[nodiscard]] bool was_asked_for(std::span<const std::byte> bytes, const std::string& name);

/// The identity of the run that wrote a checkpoint. Throws Error (BadInput) when `bytes` are no checkpoint, damaged, or
/// of another version.
[[nodiscard]] RunIdentity identity_in(std::span<const std::byte> bytes, const std::string& name);

/// Fills `film`, a new one of the same layout and content. `name` stands in errors. Throws Error (BadInput) when
/// `bytes` are no checkpoint, damaged, of another version, or of a run with another identity: then the error names what
/// differs. Nothing of damaged bytes but the header is looked at, and of others no sum is taken that a run cannot have.
[[nodiscard]] SampleProgress decode_checkpoint(std::span<const std::byte> bytes, const std::string& name,
                                               const RunIdentity& identity, Film& film);

/// What decides the bits of a frame: this program, the scene, the views, how they are sampled and lit (every setting
/// that says so in the table); and what is kept of it beside the picture. `settings` are resolved.
[[nodiscard]] RunIdentity identity_of(const Session& session, const FramePlan& plan, std::span<const View> views,
                                      const RenderSettings& settings, bool keeps_keys);

/// What made the keys of the run with this identity; Auto where the identity does not name it.
[[nodiscard]] Primary primary_of(const RunIdentity& identity);

/// Whether a device made keys or light of the run with this identity.
[[nodiscard]] bool had_device(const RunIdentity& identity);

}  // namespace hpr
