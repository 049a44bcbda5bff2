#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// What is known of texels without looking at them.
struct TexelFacts {
  Rgba8 least{255, 255, 255, 255};  ///< of each channel
  Rgba8 largest{0, 0, 0, 0};
  std::uint64_t content = 0;  ///< their hash

  bool operator==(const TexelFacts&) const = default;
};

[[nodiscard]] TexelFacts facts_of(std::span<const Rgba8> texels);

/// Keeps texels that come when they are first looked at, and may go again between frames.
class TexelStore {
 public:
  /// What texels are just now. Those that are kept stay where they are until forget_unused(), which makes InUse of all
  /// Kept.
  enum State : std::uint32_t { Absent, Coming, Kept, InUse };

  TexelStore() = default;
  TexelStore(const TexelStore&) = delete;
  TexelStore& operator=(const TexelStore&) = delete;
  virtual ~TexelStore() = default;

  /// Returns once the texels of picture `number` are InUse; from any thread. Throws Error where they cannot be had.
  virtual void fetch(std::uint32_t number) = 0;
  /// Collective over the ranks that share the store, between frames, when nobody looks at texels: past the store's
  /// limit those go that were not used for longest.
  virtual void forget_unused() = 0;
};

/// The texels of a picture, [height][width], row 0 at the top, as stored in its file. They never change; copies are of
/// the same memory.
class Texels {
 public:
  Texels() = default;
  // NOLINTNEXTLINE(google-explicit-constructor): a picture's texels are its pixels
  Texels(Image<Rgba8> image);
  /// What is known of texels that are elsewhere; they cannot be looked at.
  Texels(Size size, const TexelFacts& facts) : size_(size), facts_(facts) {}
  /// In memory that lasts as long as `owner`.
  Texels(Size size, const TexelFacts& facts, const Rgba8* texels, std::shared_ptr<const void> owner)
      : size_(size), texels_(texels), owner_(std::move(owner)), facts_(facts) {}
  /// Of a store that may not have them yet; `state`: what they are there.
  Texels(Size size, const TexelFacts& facts, const Rgba8* texels, std::shared_ptr<TexelStore> store,
         std::uint32_t number, std::uint32_t* state)
      : size_(size),
        texels_(texels),
        state_(state),
        store_(store.get()),
        owner_(std::move(store)),
        number_(number),
        facts_(facts) {}

  [[nodiscard]] Size size() const { return size_; }
  [[nodiscard]] int width() const { return size_.width; }
  [[nodiscard]] int height() const { return size_.height; }
  [[nodiscard]] std::size_t size_bytes() const { return size_.area() * sizeof(Rgba8); }
  [[nodiscard]] const TexelFacts& facts() const { return facts_; }
  /// Whether they are here, or come when they are looked at.
  [[nodiscard]] bool is_reachable() const { return texels_ != nullptr || size_.area() == 0; }
  /// Whether these are of the same memory.
  [[nodiscard]] bool is_same(const Texels& other) const { return texels_ == other.texels_ && size_ == other.size_; }

  [[nodiscard]] bool is_here() const {
    return state_ == nullptr || std::atomic_ref(*state_).load(std::memory_order_acquire) == TexelStore::InUse;
  }
  /// Whether they take memory here.
  [[nodiscard]] bool is_kept() const {
    return state_ == nullptr || std::atomic_ref(*state_).load(std::memory_order_acquire) != TexelStore::Absent;
  }
  /// Waits for texels that are not here. To be called before at().
  void require() const {
    if (!is_here()) store_->fetch(number_);
  }
  [[nodiscard]] const Rgba8& at(int x, int y) const {
    return texels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(size_.width) + static_cast<std::size_t>(x)];
  }
  /// All of them, row by row; waits for them.
  [[nodiscard]] std::span<const Rgba8> pixels() const {
    require();
    return {texels_, texels_ == nullptr ? 0 : size_.area()};
  }
  /// A copy; waits for them.
  [[nodiscard]] Image<Rgba8> image() const;

  /// Whether sizes and texels are equal.
  friend bool operator==(const Texels& a, const Texels& b) { return a.size_ == b.size_ && a.facts_ == b.facts_; }

 private:
  Size size_;
  const Rgba8* texels_ = nullptr;
  std::uint32_t* state_ = nullptr;  ///< null: they are here
  TexelStore* store_ = nullptr;     ///< which owner_ holds
  std::shared_ptr<const void> owner_;
  std::uint32_t number_ = 0;
  TexelFacts facts_;
};

}  // namespace hpr
