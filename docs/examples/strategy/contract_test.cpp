#include "compositing/compositor_contract.h"
#include "compositing/plugin.h"

// What HPR asks of its own strategies, asked of the one this program is linked with.
namespace hpr::test {

INSTANTIATE_TEST_SUITE_P(Mine, CompositorContract, testing::ValuesIn(contract_cases(hpr_compositor_plugin()->make)),
                         contract_case_name);

}  // namespace hpr::test
