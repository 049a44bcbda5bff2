#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "core/file.h"
#include "scene/scene.h"

namespace hpr {

/// Which piece of which mesh of a page: see PartPieces.
struct PagePiece {
  std::uint32_t mesh = 0;
  std::uint32_t vertices = 0;  ///< of all of the mesh that the page has
  std::uint32_t triangles = 0;
};

/// The triangles of this rank's part of a scene, in pages that lie in a file without a name in temporary_folder(). Some
/// are in memory at a time: those that were used last.
class PartPages {
 public:
  /// `part`: which of Scene::parts. Throws Error (Io).
  PartPages(std::size_t part, std::size_t pages);
  ~PartPages();
  PartPages(const PartPages&) = delete;
  PartPages& operator=(const PartPages&) = delete;

  /// Adds a piece of a mesh to a page, of each mesh in their order, as bytes that append_bytes() made of it. Before the
  /// page is used. Throws Error (Io).
  void add(std::size_t page, const PagePiece& piece, std::span<const std::byte> bytes);

  /// Once all pieces are there: as many pages are in memory at a time as take no more bytes together than `room`, were
  /// all as large as the largest. One at least is: then more than `room` may be taken.
  void keep_in(std::uint64_t room);

  [[nodiscard]] std::size_t part() const { return part_; }
  [[nodiscard]] std::size_t size() const { return pages_.size(); }
  [[nodiscard]] std::size_t max_resident() const { return max_resident_; }
  [[nodiscard]] bool is_resident(std::size_t page) const;
  /// All pages, those first that are in memory.
  [[nodiscard]] std::vector<std::size_t> nearest_first() const;
  /// How often a page was read from the file.
  [[nodiscard]] std::uint64_t loads() const { return loads_; }
  /// What the triangles of pages take that are in memory and not in use.
  [[nodiscard]] std::uint64_t memory() const;
  /// The largest page's arrays in bytes, as the file has them.
  [[nodiscard]] std::uint64_t bytes_of_largest() const;
  /// Who has more of a page in memory than its triangles is told when it leaves.
  void on_leave(std::function<void(std::size_t page)> call) { on_leave_ = std::move(call); }

 private:
  friend class PageInUse;
  /// A piece in the file.
  struct Piece {
    PagePiece piece;
    std::uint64_t at = 0;
    std::uint64_t bytes = 0;
    std::uint64_t hash = 0;
  };
  struct Page {
    std::vector<Piece> pieces;
    std::vector<std::pair<std::uint32_t, Mesh>> meshes;  ///< by their number; in memory only
  };

  void bring(std::size_t page);
  void read(Page& page);

  std::size_t part_;
  std::size_t max_resident_ = 1;
  TemporaryFile file_;
  int descriptor_ = -1;
  std::uint64_t file_bytes_ = 0;
  std::vector<Page> pages_;
  std::vector<std::size_t> resident_;  ///< the one used last at the end
  std::uint64_t loads_ = 0;
  bool is_in_use_ = false;
  std::function<void(std::size_t)> on_leave_;
};

/// While it lives the scene has the triangles of one page of its part; at other times none of any. There is one of
/// these at a time, and it comes and goes while nobody else looks at the scene's meshes.
class PageInUse {
 public:
  /// Reads the page where it is not in memory. Throws Error (Io).
  PageInUse(Scene& scene, std::size_t page);
  ~PageInUse();
  PageInUse(const PageInUse&) = delete;
  PageInUse& operator=(const PageInUse&) = delete;

 private:
  void swap_meshes();

  Scene& scene_;
  PartPages::Page& page_;
};

/// The surfaces of one page of this rank's part.
[[nodiscard]] std::span<const SurfaceRange> surfaces_of_page(const Scene& scene, std::size_t page);

}  // namespace hpr
