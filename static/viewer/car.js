// The car's response to its commands, as the simulator has it (paddock/simulator/response.py and car.py), with the body
// as plain geometry in place of Bullet. A test holds it to the simulator on recorded commands.

const RAD = Math.PI / 180;
const MOVE_HZ = 60; // of Bullet
const MOVES = 4; // in a control step
// What Bullet's solver leaves of the wheels' constraints in a move, fitted on recorded commands: shares of the change of
// curvature at the move's end and start, of the change of speed, of both, two pulls to one side, and two small gains.
const REST = [0.27725, -0.31292, -0.03063, 0.61613, -0.01816, 0.01092, 0.00241, 0.02113];

// Dead times, lags, limits and grip between a command and the wheels, tick by tick.
export class Response {
  constructor(physics) {
    Object.assign(this, { physics, speed: 0, demand: 0, wantedSpeed: 0, wantedDemand: 0, tick: 0, steering: [], speeds: [] });
    const gain = (lag) => (lag <= 0 ? 1 : 1 - Math.exp(-1 / (physics.tick_hz * lag)));
    this.rise = gain(physics.speed_rise_s);
    this.fall = gain(physics.speed_fall_s);
  }

  // 1/m, of the path of the rear axle now.
  get curvature() {
    const { curvature_limit: limit, curvature_limit_falloff: falloff, curvature_limit_sharpness: sharpness } = this.physics;
    const most = limit / (1 + falloff * this.speed * this.speed);
    return this.demand / (1 + (Math.abs(this.demand) / most) ** sharpness) ** (1 / sharpness);
  }

  // Degrees to the left, m/s.
  command(steering, speed) {
    const p = this.physics;
    const angle = Math.max(-p.max_steering_deg, Math.min(p.max_steering_deg, steering));
    this.steering.push([this.tick + p.steering_dead_ticks, Math.tan(angle * RAD) / p.effective_wheelbase]);
    this.speeds.push([this.tick + p.speed_dead_ticks, Math.max(p.min_speed, Math.min(p.max_speed, speed)) * p.speed_gain]);
  }

  advance(ticks) {
    const p = this.physics, most = [p.acceleration / p.tick_hz, p.braking / p.tick_hz];
    for (const end = this.tick + ticks; this.tick < end; this.tick += 1) {
      while (this.steering.length && this.steering[0][0] <= this.tick) [, this.wantedDemand] = this.steering.shift();
      while (this.speeds.length && this.speeds[0][0] <= this.tick) [, this.wantedSpeed] = this.speeds.shift();
      const change = this.wantedSpeed - this.speed;
      this.speed += change > 0 ? Math.min(most[0], this.rise * change) : -Math.min(most[1], -this.fall * change);
      // one tick of a first-order lag, solved backwards
      this.demand += (this.wantedDemand - this.demand) / (1 + p.steering_lag_s_per_mps * p.tick_hz * this.speed);
    }
  }
}

export class DrivenCar {
  constructor(physics, pose) {
    this.physics = physics;
    this.long = physics.front_axle_x - physics.rear_axle_x;
    // a motor removes a fixed share of the difference in each move, aimed so that it arrives with the last
    const left = (moves) => 1 - (1 - physics.motor_gain) ** moves;
    this.shares = Array.from({ length: MOVES + 1 }, (_, k) => left(k) / left(MOVES));
    this.place(pose);
  }

  // Put it there, standing still; x and y are the middle between the axles.
  place({ x, y, yaw }) {
    Object.assign(this, { x, y, yaw, response: new Response(this.physics), speed: 0, curvature: 0, before: { speed: 0, curvature: 0 } });
  }

  // Angles of the front wheels on a path of that curvature, and back.
  hinges(curvature) {
    const side = this.physics.half_track * curvature, rise = this.long * curvature;
    return [Math.atan(rise / (1 - side)), Math.atan(rise / (1 + side))];
  }

  bend([left, right]) {
    const [l, r] = [Math.tan(left), Math.tan(right)], half = this.physics.half_track;
    return (l / (this.long + half * l) + r / (this.long - half * r)) / 2;
  }

  // One control step (1/15 s): the pose after each of its moves.
  step(steering, speed) {
    const { response, shares } = this, from = response.speed, old = this.hinges(response.curvature);
    response.command(steering, speed);
    response.advance(this.physics.ticks_per_step);
    const to = response.speed, next = this.hinges(response.curvature), poses = [];
    const [atEnd, atStart, braking, both, pull, brakePull, more, faster] = REST;
    for (let k = 1; k <= MOVES; k += 1) {
      const v = from + shares[k] * (to - from), bent = this.curvature, dv = v - this.before.speed;
      this.curvature = this.bend(old.map((angle, n) => angle + shares[k] * (next[n] - angle)));
      const change = this.curvature - bent, earlier = bent - this.before.curvature;
      const rate = v * bent + v * (atEnd * change + atStart * earlier) + dv * (braking * bent + both * change)
        + pull * Math.abs(v * change) + brakePull * Math.abs(dv * bent) + more * v * bent + faster * v * v * change;
      // it is the rear axle that moves straight ahead
      const aside = -this.physics.rear_axle_x * rate, [c, s] = [Math.cos(this.yaw), Math.sin(this.yaw)];
      this.x += (v * c - aside * s) / MOVE_HZ;
      this.y += (v * s + aside * c) / MOVE_HZ;
      this.yaw += rate / MOVE_HZ;
      this.before = { speed: v, curvature: bent };
      this.speed = v;
      poses.push({ x: this.x, y: this.y, yaw: this.yaw, v });
    }
    return poses;
  }
}
