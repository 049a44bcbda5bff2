#include "cluster/distribution/texture_distribution.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cereal/archives/binary.hpp>
#include <cereal/types/string.hpp>
#include <cereal/types/vector.hpp>
#include <chrono>
#include <cstring>
#include <map>
#include <optional>
#include <sstream>
#include <thread>
#include <utility>

#include "cluster/transport/collectives.h"
#include "cluster/transport/host_memory.h"
#include "core/bytes.h"
#include "core/error.h"
#include "scene/picture_source.h"

namespace hpr {

template <typename Archive>
void serialize(Archive& archive, PictureSource& s) {
  archive(s.name, s.file, s.file_bytes, s.offset, s.length, s.hash);
}

namespace {

/// Texels that one or more textures have, as all ranks know them.
struct Picture {
  std::uint32_t texture = 0;  ///< the first that has them
  bool is_encoded = false;
  PictureSource source;

  template <typename Archive>
  void serialize(Archive& archive) {
    archive(texture, is_encoded, source);
  }
};

/// What all ranks know of a scene's texels.
struct PictureList {
  std::vector<Picture> pictures;
  std::vector<std::uint32_t> of_texture;
  std::uint64_t room = 0;  ///< bytes for each rank

  template <typename Archive>
  void serialize(Archive& archive) {
    archive(pictures, of_texture, room);
  }
};

PictureList list_pictures(const TextureContents& contents) {
  PictureList list;
  std::map<const void*, std::uint32_t> known;
  for (std::uint32_t i = 0; i < contents.texels.size(); ++i) {
    const PictureSource* const source = contents.sources[i].get();
    const Texels& texels = contents.texels[i];
    const void* const identity = source != nullptr         ? static_cast<const void*>(source)
                                 : texels.size_bytes() > 0 ? static_cast<const void*>(texels.pixels().data())
                                                           : static_cast<const void*>(&texels);
    const auto [entry, is_new] = known.try_emplace(identity, static_cast<std::uint32_t>(list.pictures.size()));
    if (is_new) list.pictures.push_back({i, source != nullptr, source != nullptr ? *source : PictureSource{}});
    list.of_texture.push_back(entry->second);
  }
  return list;
}

std::vector<std::byte> packed(const PictureList& list) {
  std::ostringstream stream;
  cereal::BinaryOutputArchive archive(stream);
  archive(list);
  const std::string text = std::move(stream).str();
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

PictureList unpacked(std::span<const std::byte> bytes, std::size_t textures) {
  std::istringstream stream(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  cereal::BinaryInputArchive archive(stream);
  PictureList list;
  archive(list);
  HPR_CHECK(list.of_texture.size() == textures);
  return list;
}

constexpr std::size_t kPage = 4096;
constexpr std::size_t kLine = 64;

std::size_t rounded_up(std::size_t bytes, std::size_t step) {
  return (bytes + step - 1) / step * step;
}

/// What of a picture's texels is in a host's memory.
struct PictureState {
  std::uint32_t state = TexelStore::Absent;
  std::uint32_t unused_frames = 0;
};

/// Where things stand in a host's memory: states, texels, and encoded bytes where they are kept there.
struct Layout {
  std::vector<std::size_t> texels;   ///< of each picture
  std::vector<std::size_t> encoded;  ///< of each picture; empty where files are read
  std::size_t bytes = 0;

  Layout(const PictureList& list, const Scene& scene, bool keeps_encoded) {
    bytes = rounded_up(list.pictures.size() * sizeof(PictureState), kPage);
    for (const Picture& picture : list.pictures) {
      // Whole pages can be given back; small pictures share them.
      const std::size_t size = scene.textures[picture.texture].image.size_bytes();
      bytes = rounded_up(bytes, size < kPage ? kLine : kPage);
      texels.push_back(bytes);
      bytes += size;
    }
    if (!keeps_encoded) return;
    for (const Picture& picture : list.pictures) {
      bytes = rounded_up(bytes, kLine);
      encoded.push_back(bytes);
      if (picture.is_encoded) bytes += picture.source.length;
    }
  }
};

/// The pictures of a scene in a host's memory.
class HostTexels final : public TexelStore {
 public:
  HostTexels(Communicator& comm, const PictureList& list, const Scene& scene, bool keeps_encoded)
      : layout_(list, scene, keeps_encoded), memory_(comm, layout_.bytes), hang_timeout_(comm.hang_timeout()) {
    for (const Picture& picture : list.pictures) {
      const Texels& texels = scene.textures[picture.texture].image;
      pictures_.push_back({texels.size(), texels.facts(), picture.is_encoded, picture.source});
    }
  }

  [[nodiscard]] HostMemory& memory() { return memory_; }
  [[nodiscard]] std::span<std::byte> texels(std::size_t number) const {
    return memory_.bytes().subspan(layout_.texels[number], pictures_[number].size.area() * sizeof(Rgba8));
  }
  /// Empty where files are read.
  [[nodiscard]] std::span<std::byte> encoded(std::size_t number) const {
    if (layout_.encoded.empty()) return {};
    return memory_.bytes().subspan(layout_.encoded[number], pictures_[number].source.length);
  }
  void set_limit(std::uint64_t bytes) {
    std::uint64_t all = 0;
    for (std::size_t i = 0; i < pictures_.size(); ++i) all += pictures_[i].is_encoded ? texels(i).size() : 0;
    forgets_ = bytes < all;
    limit_ = bytes;
  }

  /// Of a picture, as textures have them.
  [[nodiscard]] static Texels texels_of(const std::shared_ptr<HostTexels>& store, std::uint32_t number) {
    const KeptPicture& picture = store->pictures_[number];
    const auto* const texels = reinterpret_cast<const Rgba8*>(store->texels(number).data());
    if (picture.is_encoded) return {picture.size, picture.facts, texels, store, number, &store->state_of(number).state};
    return {picture.size, picture.facts, texels, store};
  }

  void fetch(std::uint32_t number) override {
    const std::atomic_ref<std::uint32_t> state(state_of(number).state);
    const auto deadline = std::chrono::steady_clock::now() + hang_timeout_;
    for (;;) {
      std::uint32_t now = state.load(std::memory_order_acquire);
      if (now == InUse) return;
      if (now == Kept) {
        state.compare_exchange_strong(now, InUse);
      } else if (now == Absent && state.compare_exchange_strong(now, Coming)) {
        decode(number, state);
      } else {
        // Another thread decodes it, of this rank or of another one of the host.
        std::this_thread::sleep_for(std::chrono::microseconds(100));
        if (std::chrono::steady_clock::now() > deadline) {
          throw Error(ExitCode::Hang, fmt::format("{}: not decoded within the time limit", source_of(number).name),
                      "a rank stands still or failed; raise --hang-timeout if it only needs longer");
        }
      }
    }
  }

  void forget_unused() override {
    if (!forgets_) return;
    memory_.meet();
    if (memory_.is_first()) forget_past_limit();
    memory_.meet();
  }

 private:
  struct KeptPicture {
    Size size;
    TexelFacts facts;
    bool is_encoded = false;
    PictureSource source;
  };

  [[nodiscard]] PictureState& state_of(std::size_t number) const {
    return reinterpret_cast<PictureState*>(memory_.bytes().data())[number];
  }
  [[nodiscard]] const PictureSource& source_of(std::size_t number) const { return pictures_[number].source; }

  void decode(std::uint32_t number, const std::atomic_ref<std::uint32_t>& state) {
    try {
      const KeptPicture& picture = pictures_[number];
      const std::span<const std::byte> kept = encoded(number);
      const Image<Rgba8> image = kept.empty()
                                     ? decode_picture(picture.source, read_encoded(picture.source), picture.size)
                                     : decode_picture(picture.source, kept, picture.size);
      const auto bytes = std::as_bytes(image.pixels());
      if (xxh64(bytes) != picture.facts.content) {
        throw Error(ExitCode::BadInput, fmt::format("{}: decodes to other texels on this host", picture.source.name),
                    "install the same libraries for pictures on every host");
      }
      std::memcpy(texels(number).data(), bytes.data(), bytes.size());
    } catch (...) {
      state.store(Absent);
      throw;
    }
    state.store(InUse, std::memory_order_release);
  }

  void forget_past_limit() {
    std::vector<std::uint32_t> here;
    std::uint64_t bytes = 0;
    for (std::uint32_t i = 0; i < pictures_.size(); ++i) {
      PictureState& picture = state_of(i);
      if (!pictures_[i].is_encoded || picture.state == Absent) continue;
      picture.unused_frames = picture.state == InUse ? 0 : picture.unused_frames + 1;
      picture.state = Kept;
      here.push_back(i);
      bytes += texels(i).size();
    }
    std::ranges::stable_sort(here, std::greater{}, [&](std::uint32_t i) { return state_of(i).unused_frames; });
    for (const std::uint32_t i : here) {
      if (bytes <= limit_) return;
      if (texels(i).size() < kPage) continue;
      state_of(i).state = Absent;
      HostMemory::release(texels(i));
      bytes -= texels(i).size();
    }
  }

  Layout layout_;
  HostMemory memory_;
  std::chrono::nanoseconds hang_timeout_;
  std::vector<KeptPicture> pictures_;
  std::uint64_t limit_ = 0;
  bool forgets_ = false;
};

/// What a host may hold of texels that can be read again.
std::uint64_t limit_for(const Scene& scene, std::uint64_t room, int ranks_here) {
  constexpr std::uint64_t kFixed = std::uint64_t{256} << 20U;
  std::uint64_t all = 0;
  for (const Texture& texture : scene.textures) all += texture.image.size_bytes();
  const auto parts = std::max<std::uint64_t>(scene.parts.size(), 1);
  const std::uint64_t part = all / parts * std::min(parts, static_cast<std::uint64_t>(ranks_here));
  return std::min(part + part * 2 / 5 + kFixed, room * static_cast<std::uint64_t>(ranks_here));
}

/// Fills a host's memory with what rank 0 has. A rank that failed takes part until all is sent.
class HostFiller {
 public:
  HostFiller(Communicator& comm, const PictureList& list, HostTexels& store)
      : list_(list), store_(store), is_root_(comm.rank() == 0) {
    std::vector<int> firsts;
    const std::vector<int> is_first = all_gather_value(comm, store.memory().is_first() ? 1 : 0);
    for (int rank = 0; rank < comm.size(); ++rank) {
      if (is_first[static_cast<std::size_t>(rank)] != 0) firsts.push_back(rank);
    }
    works_ = store.memory().is_first();
    if (works_ && firsts.size() > 1) between_ = comm.subset(firsts);
  }

  void fill(TextureContents& contents, bool keeps_encoded) {
    if (!works_) return;
    for (std::uint32_t i = 0; i < list_.pictures.size(); ++i) {
      const Picture& picture = list_.pictures[i];
      if (!picture.is_encoded) {
        fill_texels(i, contents);
      } else if (keeps_encoded) {
        fill_encoded(i);
      }
    }
  }
  void check() const {
    if (failure_) throw Error(*failure_);
  }

 private:
  void fill_texels(std::uint32_t number, TextureContents& contents) {
    const std::uint32_t texture = list_.pictures[number].texture;
    std::span<const std::byte> mine;
    if (is_root_) mine = std::as_bytes(contents.texels[texture].pixels());
    put(mine, store_.texels(number));
    for (std::uint32_t i = texture; i < contents.texels.size(); ++i) {
      if (list_.of_texture[i] == number) contents.texels[i] = {};  // its memory goes back
    }
  }
  void fill_encoded(std::uint32_t number) {
    const PictureSource& source = list_.pictures[number].source;
    std::vector<std::byte> mine;
    if (is_root_) mine = read(source);
    put(mine, store_.encoded(number));
  }
  /// Bytes of rank 0 to where they stand in the memory of each host.
  void put(std::span<const std::byte> mine, std::span<std::byte> to) {
    std::vector<std::byte> sent;
    if (between_) {
      if (is_root_) sent.assign(mine.begin(), mine.end());
      broadcast(*between_, sent);
      mine = sent;
    }
    if (mine.size() == to.size()) {
      std::ranges::copy(mine, to.begin());
    } else if (!failure_) {
      failure_ = Error(ExitCode::BadInput, "a texture came with other bytes than were sent",
                       "check the network and its memory");
    }
  }
  std::vector<std::byte> read(const PictureSource& source) {
    std::vector<std::byte> bytes;
    const auto failed = failure_of([&] { bytes = read_encoded(source); });
    if (failed && !failure_) failure_ = failed;
    return bytes;
  }

  const PictureList& list_;
  HostTexels& store_;
  std::unique_ptr<Communicator> between_;
  bool is_root_;
  bool works_ = false;
  std::optional<Error> failure_;
};

bool has_encoded(const PictureList& list) {
  return std::ranges::any_of(list.pictures, &Picture::is_encoded);
}

/// Whether this rank can read all pictures that lie encoded in files.
bool sees_files(const PictureList& list) {
  return std::ranges::all_of(list.pictures,
                             [](const Picture& picture) { return !picture.is_encoded || is_in_reach(picture.source); });
}

}  // namespace

TextureContents take_texels(LoadedScene& loaded) {
  TextureContents contents{{}, std::move(loaded.sources)};
  contents.sources.resize(loaded.scene.textures.size());
  for (Texture& texture : loaded.scene.textures) {
    const Texels known(texture.image.size(), texture.image.facts());
    contents.texels.push_back(std::exchange(texture.image, known));
  }
  return contents;
}

void share_textures(Communicator& comm, TextureContents contents, std::uint64_t room, Scene& scene) {
  if (scene.textures.empty()) return;
  std::vector<std::byte> bytes;
  if (comm.rank() == 0) {
    PictureList mine = list_pictures(contents);
    mine.room = room;
    bytes = packed(mine);
  }
  broadcast(comm, bytes);
  PictureList list;
  agree_on_failure(comm, [&] { list = unpacked(bytes, scene.textures.size()); });
  const bool keeps_encoded = std::ranges::count(all_gather_value(comm, sees_files(list) ? 1 : 0), 0) > 0;
  const auto store = std::make_shared<HostTexels>(comm, list, scene, keeps_encoded);
  HostFiller filler(comm, list, *store);
  filler.fill(contents, keeps_encoded);
  agree_on_failure(comm, [&] { filler.check(); });
  for (std::size_t i = 0; i < scene.textures.size(); ++i) {
    scene.textures[i].image = HostTexels::texels_of(store, list.of_texture[i]);
  }
  if (!has_encoded(list)) return;
  store->set_limit(limit_for(scene, list.room, store->memory().ranks()));
  scene.texel_store = store;
}

}  // namespace hpr
