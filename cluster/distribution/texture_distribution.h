#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "cluster/transport/communicator.h"
#include "scene/load_scene.h"
#include "scene/scene.h"

namespace hpr {

/// The texels of a scene's textures, by texture: those that were read, or where they can be read.
struct TextureContents {
  std::vector<Texels> texels;
  std::vector<std::shared_ptr<const PictureSource>> sources;  ///< null: `texels` are all of it
};

/// Takes the texels out of a scene, of whose textures all but these is then known.
[[nodiscard]] TextureContents take_texels(LoadedScene& loaded);

/// Collective. Gives the textures of a scene, of which all ranks know the same, their texels, which rank 0 has
/// (`contents`, on others empty): once for each host, in memory that its ranks share. Texels that can be read from
/// where they lie encoded come when they are first looked at; hosts that do not see the scene's files get the encoded
/// bytes. Of these a host forgets those that were not used for longest (TexelStore::forget_unused) past 1.4 times its
/// share, as it holds parts of the scene, and 256 MiB, or past `room` bytes (as rank 0 says) for each of its ranks.
void share_textures(Communicator& comm, TextureContents contents, std::uint64_t room, Scene& scene);

}  // namespace hpr
