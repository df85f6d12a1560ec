"""PPO and SAC of stable-baselines3 with the console's hyperparameters.

How the console's names map onto stable-baselines3's:

- ``batch_size``, ``num_epochs`` (SAC: passes over as many steps as were just driven), ``lr``, ``discount_factor``:
  ``batch_size``, ``n_epochs``, ``learning_rate``, ``gamma``.
- ``beta_entropy``: ``ent_coef`` of PPO; ``sac_alpha``: a fixed ``ent_coef`` of SAC. Both fall in a straight line over
  the training, by the share ``entropy_decay`` until its end.
- ``loss_type``: the loss of the value function (SAC: of both critics), Huber with delta 1 or mean squared error.
- ``num_episodes_between_training``: steps between two updates, see ``TrainerSpec.steps_each``.
- The field's fixed values: clip 0.2 (upwards 0.5 for the guide), GAE lambda 0.95, Adam epsilon 1e-5.
"""

import codecs
import io
import json
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import cloudpickle
import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import RolloutBufferSamples, TrainFreq, TrainFrequencyUnit
from stable_baselines3.common.utils import polyak_update
from stable_baselines3.common.vec_env import VecEnv
from torch import nn
from torch.nn import functional

from paddock.rules.hyperparameters import HUBER

from . import torso
from .mirror_augmentation import Mirror
from .network import FEATURES, NetworkLayout
from .road_state import LENGTH
from .spec import TrainerSpec
from .warm_up import row_space, torso_arguments

_CLIP, _LAMBDA, _GRADIENT_NORM = 0.2, 0.95, 0.5
_SAC_MEMORY = 20_000  # steps that SAC learns from: 0.2 GB of pooled pictures
_SAC_MEMORY_UNPOOLED = 5_000  # the same in pictures of the console's network
_SAC_TAU = 0.02  # the share of the critics that their targets take over at each step of learning
_MOST_LIKELIER = 3.0  # e^50, as of a mirrored action that a sharp policy hardly ever takes, has no finite gradient
_CLONE_LOG_STD = -1.0  # a clone knows its way: it explores less than a beginner
_CONTRAST = (0.3, 5.0)  # of a guided training's pictures, see :class:`.torso.Torso`
_GUIDE_CLIP = 0.5
_GUIDED_STEPS = 100_000
_FOLLOWED = 5  # times that as many steps are followed as were just driven, drawn from the latest
_SHOWN = 5_040  # steps, or all of the last update
_SHARPNESS = 3.0  # of the guide's preferences, in their standard deviations; as it drives it chooses nearly at random

cloudpickle.register_pickle_by_value(torso)
codecs.lookup("cp437")  # of names in a zip that is opened again: a locked process cannot import it
warnings.filterwarnings("ignore", "You have specified a mini-batch size")  # the last one of an update may be smaller


@dataclass(frozen=True)
class Losses:
    """Means over one update. ``entropy`` of SAC is minus the mean log probability of its actions."""

    entropy: float
    policy: float
    value: float


class _Road(BaseFeaturesExtractor):
    """The state of the road at the end of a row."""

    def __init__(self, observation_space: Any) -> None:
        super().__init__(observation_space, LENGTH)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return observations[:, -LENGTH:]


class Learner:
    """One of the two algorithms on a set of cars; :meth:`update` is one iteration.

    With ``guided`` a second policy, the guide, learns by PPO, too, and drives after the first update. It sees the state
    of the road instead of pictures and so learns from the same rewards in a fifth of the steps. The car's own policy
    follows it: it learns from the pictures where the road is and what the guide does there, until after many steps PPO
    goes on with it alone (:meth:`go_alone`). Pinto et al. 2017, Asymmetric Actor Critic; Jaderberg et al. 2016, UNREAL;
    Chen et al. 2019, Learning by Cheating, whose guide learns from an expert, this one from rewards alone.
    """

    def __init__(
        self,
        spec: TrainerSpec,
        layout: NetworkLayout,
        cars: VecEnv,
        callback: BaseCallback,
        hurry: Callable[[], bool] = lambda: False,
        mirror: Mirror | None = None,
        share: Callable[[], float] = lambda: 0.0,
        guided: bool = False,
    ) -> None:
        """``callback`` is called after each control step, ``hurry`` between the steps of learning: if it is true, the
        update ends, and one of PPO is undone. ``mirror`` turns half of each batch of PPO round. ``share``: the share of
        the training that is over. ``guided``: the rows of ``cars`` end with the state of the road."""
        self.spec, self.layout = spec, layout
        self._mirror, self._share, self._hurry = mirror, share, hurry
        self._driven = 0  # steps of all cars since the last update
        self.sac = spec.algorithm == "sac"
        values = spec.hyperparameters
        self.loss = functional.huber_loss if values["loss_type"] == HUBER else functional.mse_loss
        policy = {"features_extractor_class": torso.Torso, "features_extractor_kwargs": torso_arguments(layout)}
        common: dict[str, Any] = {
            "learning_rate": values["lr"],
            "batch_size": values["batch_size"],
            "gamma": values["discount_factor"],
            "seed": spec.seed,
            "device": "cpu",
        }
        self.model: Any  # PPO or SAC, whose parts torch finds by their names
        if self.sac:
            self.model = SAC(
                "MlpPolicy",
                cars,
                buffer_size=_SAC_MEMORY if layout.senses[0].pool > 1 else _SAC_MEMORY_UNPOOLED,
                learning_starts=0,
                tau=_SAC_TAU,
                ent_coef=values["sac_alpha"],
                policy_kwargs={**policy, "net_arch": {"pi": [], "qf": [FEATURES]}},
                **common,
            )
        else:
            self.model = PPO(
                "MlpPolicy",
                cars,
                n_steps=spec.steps_each,
                n_epochs=values["num_epochs"],
                gae_lambda=_LAMBDA,
                clip_range=_CLIP,
                ent_coef=values["beta_entropy"],
                max_grad_norm=_GRADIENT_NORM,
                policy_kwargs={**policy, "net_arch": []},
                **common,
            )
        self._policy = self.model.policy  # the car's own; the model's is the one that drives
        self._guide: ActorCriticPolicy | None = None
        self._shown = np.empty((0, *(cars.observation_space.shape or ())), np.float32)  # the latest rows with the guide
        if guided:
            self._guide = ActorCriticPolicy(
                *(cars.observation_space, cars.action_space, self.model.lr_schedule),
                net_arch=[FEATURES, FEATURES],
                features_extractor_class=_Road,
            )
            self._policy.features_extractor.contrast = _CONTRAST
            self._sight = nn.Linear(layout.features, LENGTH)  # of the features of pictures, into the state of the road
            self._sight_optimiser = torch.optim.Adam(self._sight.parameters(), lr=values["lr"], eps=1e-5)
        for optimiser in self._optimisers:
            for group in optimiser.param_groups:
                group["fused"] = True  # one pass over the weights instead of eight
        self.model.set_logger(Logger(folder=None, output_formats=[]))
        _, self._callback = self.model._setup_learn(2**31 - 1, callback)

    def drive(self) -> bool:
        """Drive until the next update is due. False: the callback stopped it."""
        model = self.model
        steps = self.spec.rollout_steps(model.num_timesteps)
        self._driven = steps * model.env.num_envs
        if self.sac:
            rollout = model.collect_rollouts(
                model.env,
                train_freq=TrainFreq(steps, TrainFrequencyUnit.STEP),
                action_noise=None,
                callback=self._callback,
                learning_starts=0,
                replay_buffer=model.replay_buffer,
            )
            return rollout.continue_training
        model.rollout_buffer.buffer_size = steps  # it is made anew for each rollout
        return model.collect_rollouts(model.env, self._callback, model.rollout_buffer, steps)

    def exploring(self) -> float:
        """The present entropy coefficient, which falls over the training by ``entropy_decay``."""
        values = self.spec.hyperparameters
        worth = float(values["sac_alpha" if self.sac else "beta_entropy"])
        decay = float(values.get("entropy_decay", 0.0))  # earlier versions stored none
        return worth * (1.0 - decay * min(max(self._share(), 0.0), 1.0)) if decay else worth

    def update(self) -> Losses:
        self._policy.set_training_mode(True)
        return self._update_sac() if self.sac else self._update_ppo()

    @property
    def guided(self) -> bool:
        """Whether a guide drives."""
        return self.model.policy is not self._policy

    def go_alone(self) -> None:
        """From now on the car's own policy drives and learns by itself."""
        self.model.policy, self._guide = self._policy, None
        self._shown = self._shown[:0].copy()

    def _update_ppo(self) -> Losses:
        """An update that is cut short is undone, because within it a car may drive far worse than before or after."""
        before = [(one, {name: it.clone() for name, it in one.state_dict().items()}) for one in self._policies]
        losses: list[tuple[float, float, float]] = []
        done = all(self._learn(one, losses) for one in ([self._guide] if self.guided else self._policies))
        if done and self.guided:
            done = self._follow()
        if not done:
            for policy, weights in before:
                policy.load_state_dict(weights)
        elif self.model.num_timesteps >= _GUIDED_STEPS:
            self.go_alone()
        elif self._guide is not None:
            self.model.policy = self._guide
        return _means(losses)

    def _learn(self, policy: Any, losses: list[tuple[float, float, float]]) -> bool:
        """As ``PPO.train`` of stable-baselines3 2.9, with a choice of the value loss; whether it came to the end."""
        model = self.model
        bonus = self.exploring()
        upwards = _GUIDE_CLIP if policy is self._guide else _CLIP
        discrete = self.spec.metadata["action_space_type"] == "discrete"
        batches = self._mirrored_batches() if self._turns else lambda: model.rollout_buffer.get(model.batch_size)
        for _ in range(model.n_epochs):
            for batch in batches():
                actions = batch.actions.long().flatten() if discrete else batch.actions
                values, log_prob, entropy = policy.evaluate_actions(batch.observations, actions)
                advantages = batch.advantages
                if len(advantages) > 1:
                    advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
                ratio = torch.exp((log_prob - batch.old_log_prob).clamp(max=_MOST_LIKELIER))
                clipped = torch.clamp(ratio, 1 - _CLIP, 1 + upwards)
                policy_loss = -torch.min(advantages * ratio, advantages * clipped).mean()
                value_loss = self.loss(values.flatten(), batch.returns)
                spread = entropy.mean()
                loss = policy_loss - bonus * spread + model.vf_coef * value_loss
                policy.optimizer.zero_grad()
                loss.backward()
                torch.nn.utils.clip_grad_norm_(policy.parameters(), model.max_grad_norm)
                policy.optimizer.step()
                losses.append((spread.item(), policy_loss.item(), value_loss.item()))
                if self._hurry():
                    return False
            model._n_updates += 1
        return True

    def _follow(self) -> bool:
        """The car's own policy learns from the pictures what the guide makes of the same places; whether it came to
        the end. Its preferences count by their differences, as it only begins to decide."""
        model, policy = self.model, self._policy
        guide: Any = self._guide
        driven = model.rollout_buffer.observations.reshape(-1, *model.observation_space.shape)
        self._shown = np.concatenate([self._shown, driven])[-max(_SHOWN, len(driven)) :]
        rows = torch.from_numpy(self._shown)
        discrete = self.spec.metadata["action_space_type"] == "discrete"
        with torch.no_grad():
            values, wanted = guide.predict_values(rows), guide.get_distribution(rows).distribution
            if discrete:
                scores = wanted.logits - wanted.logits.mean(1, keepdim=True)
                actions = torch.softmax(_SHARPNESS * scores / (scores.std() + 1e-8), 1)
            else:
                actions = wanted.mean
                policy.log_std.copy_(guide.log_std)
        alike = functional.cross_entropy if discrete else functional.mse_loss
        for _ in range(max(1, _FOLLOWED * len(driven) // model.batch_size)):
            some = torch.randint(len(rows), (model.batch_size,))
            features = policy.features_extractor(rows[some])
            loss = alike(policy.action_net(features), actions[some])
            loss = loss + model.vf_coef * functional.mse_loss(policy.value_net(features.detach()), values[some])
            loss = loss + 0.5 * functional.mse_loss(self._sight(features), rows[some, -LENGTH:])
            policy.optimizer.zero_grad()
            self._sight_optimiser.zero_grad()
            loss.backward()
            policy.optimizer.step()
            self._sight_optimiser.step()
            if self._hurry():
                return False
        return True

    @property
    def _turns(self) -> bool:
        return self._mirror is not None and self._mirror.holds

    def _mirrored_batches(self) -> Callable[[], Iterator[RolloutBufferSamples]]:
        """A source of an epoch's batches: each step as driven or mirrored, at random. The probability of mirrored steps
        comes from the policy that drove."""
        model, mirror, buffer = self.model, self._mirror, self.model.rollout_buffer
        assert mirror is not None
        next(buffer.get(model.batch_size))  # it lays itself out flat
        discrete = self.spec.metadata["action_space_type"] == "discrete"
        count, size = buffer.buffer_size * buffer.n_envs, model.batch_size
        likely = torch.empty(count)
        with torch.no_grad():
            for at in range(0, count, size):  # in the sizes that are met before the lock
                driven = buffer._get_samples(np.arange(at, min(at + size, count)))
                actions = mirror.actions(driven.actions)
                actions = actions.long().flatten() if discrete else actions
                likely[at : at + size] = model.policy.evaluate_actions(mirror.rows(driven.observations), actions)[1]

        def batches() -> Iterator[RolloutBufferSamples]:
            order, turned = np.random.permutation(count), np.random.randint(0, 2, count).astype(bool)
            for at in range(0, count, size):
                some = order[at : at + size]
                batch, which = buffer._get_samples(some), torch.from_numpy(turned[some])
                rows, actions, log_prob = batch.observations, batch.actions, batch.old_log_prob
                rows[which], actions[which] = mirror.rows(rows[which]), mirror.actions(actions[which])
                log_prob[which] = likely[some][which]
                yield batch

        return batches

    def _update_sac(self) -> Losses:
        """As ``SAC.train`` of stable-baselines3 2.9 with a fixed alpha, with a choice of the critics' loss."""
        model, losses = self.model, []
        alpha = self.exploring()
        for _ in range(max(1, self.spec.hyperparameters["num_epochs"] * self._driven // model.batch_size)):
            batch = model.replay_buffer.sample(model.batch_size)
            actions, log_prob = model.actor.action_log_prob(batch.observations)
            log_prob = log_prob.reshape(-1, 1)
            with torch.no_grad():
                next_actions, next_log_prob = model.actor.action_log_prob(batch.next_observations)
                following = torch.cat(model.critic_target(batch.next_observations, next_actions), dim=1)
                following = following.min(dim=1, keepdim=True).values - alpha * next_log_prob.reshape(-1, 1)
                target = batch.rewards + (1 - batch.dones) * model.gamma * following
            judged = model.critic(batch.observations, batch.actions)
            value_loss: Any = 0.5 * sum(self.loss(one, target) for one in judged)
            model.critic.optimizer.zero_grad()
            value_loss.backward()
            model.critic.optimizer.step()
            model.critic.requires_grad_(False)  # only evaluated here, not trained: a seventh of the time
            least = torch.cat(model.critic(batch.observations, actions), dim=1).min(dim=1, keepdim=True).values
            policy_loss = (alpha * log_prob - least).mean()
            model.actor.optimizer.zero_grad()
            policy_loss.backward()
            model.actor.optimizer.step()
            model.critic.requires_grad_(True)
            polyak_update(model.critic.parameters(), model.critic_target.parameters(), model.tau)
            losses.append((-log_prob.mean().item(), policy_loss.item(), value_loss.item()))
            if self._hurry():
                break
        model._n_updates += len(losses)
        return _means(losses)

    def act(self, rows: np.ndarray) -> np.ndarray:
        """The policy's outputs without exploration, for rows (n, length), as the exported network computes them."""
        return self._judged(rows, with_value=False)[0]

    def consider(self, rows: np.ndarray) -> tuple[np.ndarray, float]:
        """For one row (1, length): the outputs as of :meth:`act` and the expected reward: PPO's value, or the lower of
        SAC's critics."""
        outputs, value = self._judged(rows, with_value=True)
        return outputs[0], value

    def _judged(self, rows: np.ndarray, with_value: bool) -> tuple[np.ndarray, float]:
        policy = self._policy
        if policy.training:  # setting it again in every layer would take longer than a layer
            policy.set_training_mode(False)
        with torch.no_grad():
            seen = torch.from_numpy(rows)
            if self.sac:
                outputs = torch.tanh(policy.actor.mu(policy.actor.features_extractor(seen)))
                value = torch.cat(self.model.critic(seen, outputs), dim=1).min() if with_value else 0.0
            else:
                features = policy.features_extractor(seen)
                outputs = policy.action_net(features)
                value = policy.value_net(features) if with_value else 0.0
            return outputs.numpy(), float(value)

    def weights(self) -> dict[str, np.ndarray]:
        """The policy's weights by the names of :attr:`.network.NetworkLayout.shapes`."""
        found = {name: tensor.detach().numpy().copy() for name, tensor in self._tensors().items()}
        if self._eyes.contrast is not None:
            middle, factor = self._eyes.contrast
            for name in (f"{sense.name}.conv0" for sense in self.layout.senses if sense.spec.is_picture):
                found[name] *= np.float32(factor)
                found[f"{name}_bias"] -= np.float32(middle) * found[name].sum((1, 2, 3))
        return found

    def take(self, weights: Mapping[str, np.ndarray]) -> None:
        """Start with these weights, as a clone does."""
        with torch.no_grad():
            for name, tensor in self._tensors().items():
                tensor.copy_(torch.from_numpy(np.ascontiguousarray(weights[name])))
            if not self.sac and hasattr(self.model.policy, "log_std"):
                self.model.policy.log_std.fill_(_CLONE_LOG_STD)
            if self.sac:
                self.model.critic_target.load_state_dict(self.model.critic.state_dict())

    @property
    def _eyes(self) -> Any:
        return self._policy.actor.features_extractor if self.sac else self._policy.features_extractor

    def _tensors(self) -> dict[str, torch.Tensor]:
        policy, eyes = self._policy, self._eyes
        head = policy.actor.mu if self.sac else policy.action_net
        found: dict[str, torch.Tensor] = {}
        for sense, eye in zip(self.layout.senses, eyes.eyes, strict=True):
            weighing = [layer for layer in eye if hasattr(layer, "weight")]
            for number, layer in enumerate(weighing):
                name = f"{sense.name}.conv{number}" if sense.spec.is_picture else f"{sense.name}.dense"
                found[name], found[f"{name}_bias"] = layer.weight, layer.bias
        found["dense"], found["dense_bias"] = eyes.dense.weight, eyes.dense.bias
        found["head"], found["head_bias"] = head.weight, head.bias
        return found

    def is_finite(self) -> bool:
        """Whether no weight is NaN or infinite."""
        return all(bool(torch.isfinite(it).all()) for one in self._policies for it in one.parameters())

    @property
    def _policies(self) -> list[Any]:
        """The guide while there is one, and the car's own policy."""
        return [self._policy] if self._guide is None else [self._guide, self._policy]

    @property
    def _optimisers(self) -> list[torch.optim.Optimizer]:
        if self.sac:
            return [self._policy.actor.optimizer, self._policy.critic.optimizer]
        return [one.optimizer for one in self._policies]

    def state(self) -> dict[str, object]:
        """Weights, the optimisers' state and the number of steps, for :meth:`restore`; without SAC's replay buffer of
        0.2 GB."""
        return {
            "policy": self._policy.state_dict(),
            "guide": None if self._guide is None else self._guide.state_dict(),
            "contrast": None if self.sac else self._eyes.contrast,
            "optimisers": [one.state_dict() for one in self._optimisers],
            "steps": self.model.num_timesteps,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """``state`` may be of an earlier version, without a guide."""
        self._policy.load_state_dict(state["policy"])
        self._eyes.contrast = state.get("contrast")
        if self._guide is not None:
            self._guide.load_state_dict(state["guide"])
            self.model.policy = self._guide
        for one, kept in zip(self._optimisers, state["optimisers"], strict=True):
            one.load_state_dict(kept)
        self.model.num_timesteps = int(state["steps"])

    def to_zip(self) -> bytes:
        """The file for ``PPO.load`` or ``SAC.load`` of stable-baselines3, with the car's metadata beside the policy, so
        that it may be uploaded, too. The training is over with it: the policy takes pictures as they are."""
        self.go_alone()
        weights, self._eyes.contrast = self.weights(), None
        with torch.no_grad():
            for name, tensor in self._tensors().items():
                tensor.copy_(torch.from_numpy(weights[name]))
        self.model.observation_space = self._policy.observation_space = row_space(self.layout.senses)
        file = io.BytesIO()
        self.model.save(file, exclude=["_last_obs", "_last_original_obs", "rollout_buffer", "replay_buffer"])
        with zipfile.ZipFile(file, "a") as archive:
            member = zipfile.ZipInfo("model_metadata.json")  # with a fixed date: a locked process reads no clock
            archive.writestr(member, json.dumps(self.spec.metadata, indent=2))
        return file.getvalue()


def _means(losses: list[tuple[float, float, float]]) -> Losses:
    return Losses(*(float(value) for value in np.mean(losses, axis=0)))
