#include "scene/pages/part_pages.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/magic.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <numeric>
#include <system_error>

#include "core/bytes.h"
#include "core/error.h"
#include "core/log.h"
#include "scene/mesh_reader.h"
#include "scene/partial_mesh.h"

namespace hpr {
namespace {

Error failure_of_file(const char* doing, int error, const char* hint) {
  return {ExitCode::Io,
          fmt::format("cannot {} the pages of a scene in '{}': {}", doing, temporary_folder().string(),
                      std::generic_category().message(error)),
          hint};
}

Error write_failure(int error) {
  return failure_of_file("write", error, "set TMPDIR to a folder on a disk that has room for the scene");
}

Error read_failure(int error) {
  return failure_of_file("read", error, "their file was changed, or the disk fails: set TMPDIR to a folder on another");
}

/// Pages that lie in memory after all save none of it.
void warn_of_memory(int descriptor) {
  struct ::statfs there {};
  if (::fstatfs(descriptor, &there) != 0 || there.f_type != TMPFS_MAGIC) return;
  log::warning("'{}' keeps files in memory, pages of the scene too: set TMPDIR to a folder on a disk",
               temporary_folder().string());
}

}  // namespace

PartPages::PartPages(std::size_t part, std::size_t pages) : part_(part), pages_(pages) {
  descriptor_ = ::open(file_.path().c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor_ < 0) throw write_failure(errno);
  warn_of_memory(descriptor_);
}

PartPages::~PartPages() {
  ::close(descriptor_);
}

void PartPages::add(std::size_t page, const PagePiece& piece, std::span<const std::byte> bytes) {
  HPR_CHECK(loads_ == 0);
  pages_.at(page).pieces.push_back({piece, file_bytes_, bytes.size(), xxh64(bytes)});
  while (!bytes.empty()) {
    const ::ssize_t count = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<::off_t>(file_bytes_));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) throw write_failure(count < 0 ? errno : ENOSPC);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    file_bytes_ += static_cast<std::uint64_t>(count);
  }
}

void PartPages::keep_in(std::uint64_t room) {
  max_resident_ = static_cast<std::size_t>(std::max<std::uint64_t>(
      1, std::min<std::uint64_t>(size(), room / std::max<std::uint64_t>(bytes_of_largest(), 1))));
}

bool PartPages::is_resident(std::size_t page) const {
  return std::ranges::find(resident_, page) != resident_.end();
}

std::vector<std::size_t> PartPages::nearest_first() const {
  std::vector<std::size_t> order(size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_partition(order.begin(), order.end(), [this](std::size_t page) { return is_resident(page); });
  return order;
}

std::uint64_t PartPages::memory() const {
  std::uint64_t bytes = 0;
  for (const Page& page : pages_) {
    for (const auto& [number, mesh] : page.meshes) bytes += memory_of(mesh);
  }
  return bytes;
}

std::uint64_t PartPages::bytes_of_largest() const {
  std::uint64_t largest = 0;
  for (const Page& page : pages_) {
    std::uint64_t bytes = 0;
    for (const Piece& piece : page.pieces) bytes += piece.bytes;
    largest = std::max(largest, bytes);
  }
  return largest;
}

void PartPages::read(Page& page) {
  std::vector<std::byte> bytes;
  for (const Piece& piece : page.pieces) {
    bytes.resize(piece.bytes);
    for (std::size_t done = 0; done < bytes.size();) {
      const ::ssize_t count =
          ::pread(descriptor_, bytes.data() + done, bytes.size() - done, static_cast<::off_t>(piece.at + done));
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) throw read_failure(count < 0 ? errno : EIO);
      done += static_cast<std::size_t>(count);
    }
    if (xxh64(bytes) != piece.hash) throw read_failure(EIO);
    if (page.meshes.empty() || page.meshes.back().first != piece.piece.mesh) {
      page.meshes.emplace_back(piece.piece.mesh, Mesh());
    }
    append_piece(page.meshes.back().second, mesh_from_bytes(bytes), piece.piece.vertices, piece.piece.triangles);
  }
}

/// Into memory, in place of the one that was used longest ago.
void PartPages::bring(std::size_t page) {
  if (is_resident(page)) {
    std::erase(resident_, page);
    resident_.push_back(page);
    return;
  }
  while (resident_.size() >= max_resident_) {
    if (on_leave_) on_leave_(resident_.front());
    pages_[resident_.front()].meshes = {};
    resident_.erase(resident_.begin());
  }
  pages_.at(page).meshes.clear();
  read(pages_[page]);
  resident_.push_back(page);
  ++loads_;
}

PageInUse::PageInUse(Scene& scene, std::size_t page)
    : scene_(scene), page_([&]() -> PartPages::Page& {
        PartPages& pages = *scene.part_pages;
        HPR_CHECK(!pages.is_in_use_);
        pages.bring(page);
        pages.is_in_use_ = true;
        return pages.pages_[page];
      }()) {
  swap_meshes();
}

PageInUse::~PageInUse() {
  swap_meshes();
  scene_.part_pages->is_in_use_ = false;
}

void PageInUse::swap_meshes() {
  for (auto& [number, mesh] : page_.meshes) std::swap(scene_.meshes[number], mesh);
}

std::span<const SurfaceRange> surfaces_of_page(const Scene& scene, std::size_t page) {
  const PartPages& pages = *scene.part_pages;
  return scene.pages.at(pages.part() * pages.size() + page);
}

}  // namespace hpr
