#include "compositing/merge.h"

#include <algorithm>
#include <cstddef>

#include "core/error.h"

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "compositing/merge.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
namespace HWY_NAMESPACE {

void merge(Key* into, const Key* from, std::size_t count) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<Key> tag;
  const std::size_t lanes = hn::Lanes(tag);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(hn::Max(hn::LoadU(tag, into + i), hn::LoadU(tag, from + i)), tag, into + i);
  }
  for (; i < count; ++i) into[i] = std::max(into[i], from[i]);
}

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(merge);

void merge_keys(std::span<Key> into, std::span<const Key> from) {
  HPR_CHECK(into.size() == from.size());
  HWY_DYNAMIC_DISPATCH(merge)(into.data(), from.data(), into.size());
}

}  // namespace hpr
#endif
