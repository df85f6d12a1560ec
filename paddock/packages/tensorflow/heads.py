"""Which tensor of a frozen graph is the policy, and how its values become actions.

RL-Coach ends the graph in ``<network>/ppo_head_0/policy`` (softmax over the actions, or the mean of a normal
distribution) or in ``<network>/sac_policy_head_0/policy`` (the mean before squashing); its older heads call the mean
``policy_mean``. Source: deepracer-simapp, markov/boto/s3/constants.py (FROZEN_HEAD_OUTPUT_GRAPH_FORMAT_MAPPING) and
markov/multi_agent_coach/architectures/tensorflow_components/heads/sac_head.py: the SAC car drives
``scale * tanh(mean) + bias``, which is tanh followed by the linear scaling to low and high.
"""

from __future__ import annotations

from paddock.errors import UserFault

from .graph import Graph, TensorflowNode

_PPO, _SAC = "ppo_head_0/policy", "sac_policy_head_0/policy"
_HEADS = ((_SAC, True), (_PPO, False), (f"{_SAC}_mean", True), (f"{_PPO}_mean", False))
_PASS_ON = ("Identity", "StopGradient", "ClipByValue", "Minimum", "Maximum")


def find_policy(graph: Graph) -> tuple[TensorflowNode, bool]:
    """The policy's node, and whether tanh must follow it. Raises UserFault ``graph_output``.

    Found by the end of its name, because the scope before it differs between versions (``agent``, ``agent_0``); in a
    graph without such a name, the only node that nobody reads.
    """
    for suffix, squashed in _HEADS:
        found = [node for name, node in graph.nodes.items() if name == suffix or name.endswith("/" + suffix)]
        if len(found) == 1:
            return found[0], squashed and not _is_squashed(found[0], graph)
        if found:
            raise UserFault("graph_output")
    if len(graph.sinks) != 1:
        raise UserFault("graph_output")
    return graph.sinks[0], False


def _is_squashed(node: TensorflowNode | None, graph: Graph) -> bool:
    """Whether tanh is already the last operation that changes the values, but for a clip behind it."""
    seen = 0
    while node is not None and node.op in _PASS_ON and node.inputs and seen < len(graph.nodes):
        node, seen = graph.nodes.get(node.inputs[0][0]), seen + 1
    return node is not None and node.op == "Tanh"
