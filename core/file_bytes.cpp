#include "core/file_bytes.h"

#include <fmt/format.h>
#include <sys/mman.h>

#include "core/error.h"

namespace hpr {
namespace {

void* address_of(std::span<const std::byte> mapped) {
  return const_cast<std::byte*>(mapped.data());
}

}  // namespace

FileBytes& FileBytes::operator=(FileBytes&& other) noexcept {
  std::swap(read_, other.read_);
  std::swap(mapped_, other.mapped_);
  return *this;
}

FileBytes::~FileBytes() {
  if (!mapped_.empty()) ::munmap(address_of(mapped_), mapped_.size());
}

FileBytes FileBytes::mapped(int descriptor, std::uint64_t size) {
  FileBytes file;
  if (size == 0) return file;
  void* const at = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
  if (at == MAP_FAILED) {
    throw Error(ExitCode::Limit, fmt::format("cannot map a file of {} bytes into memory", size),
                "raise the limit of address space (ulimit -v)");
  }
  file.mapped_ = {static_cast<const std::byte*>(at), size};
  return file;
}

void FileBytes::forget() const {
  if (!mapped_.empty()) ::madvise(address_of(mapped_), mapped_.size(), MADV_DONTNEED);
}

}  // namespace hpr
