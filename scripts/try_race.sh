# shellcheck shell=sh
# Part of try_images.sh and try_units.sh, which define fail MESSAGE and inside COMMAND...: that one runs a command in
# Paddock's folder on the site's machine.

ask() { curl --silent --show-error --fail --insecure "$@"; }

until_ready() { # ADDRESS COMMAND-THAT-PRINTS-THE-LOG...
    address=$1 tries=0 since=$(date +%s)
    shift
    until ask --max-time 5 "$address/health/ready" 2>/dev/null | grep -q '"workers": true.*"workers": [1-9]'; do
        tries=$((tries + 1))
        [ $tries -lt 300 ] || fail "not ready: $("$@" 2>&1 | tail -n 30)"
        sleep 2
    done
    echo "$address: ready after $(($(date +%s) - since)) s"
}

# An admin, a house car with one weight changed, a training and a video, through the command and HTTP
race() { # ADDRESS ADDRESS-ON-THE-SITE'S-MACHINE
    inside id
    inside env DJANGO_SUPERUSER_PASSWORD=correct-horse-7 python manage.py setup --no-input --admin driver --email driver@example.org | tail -n 2
    inside python -c "
import onnx, pathlib, shutil
from onnx import numpy_helper
folder = pathlib.Path('/tmp/car')
folder.mkdir(exist_ok=True)
network = onnx.load('training/house_cars/brisk.onnx')
weights = network.graph.initializer[0]
values = numpy_helper.to_array(weights).copy()
values.flat[0] += 0.001
weights.CopyFrom(numpy_helper.from_array(values, weights.name))
onnx.save(network, folder / 'car.onnx')
shutil.copy('training/house_cars/brisk.json', folder / 'model_metadata.json')"
    token=$(ask --json '{"login": "driver", "password": "correct-horse-7"}' "$1/api/v1/auth/token/" | sed 's/.*"token": *"\([^"]*\)".*/\1/')
    race=$(ask "$1/api/v1/races/?state=open&kind=league&race_type=time_trial" | grep -o '"slug": *"[^"]*-open"' | head -n 1 | sed 's/.*"\([^"]*\)"$/\1/')
    paddock="inside env PADDOCK_SITE=$2 PADDOCK_TOKEN=$token python -m paddock.cli"
    sent=$($paddock submit /tmp/car/car.onnx /tmp/car/model_metadata.json "$race" --wait) || fail "$sent"
    echo "$sent"
    run=$(echo "$sent" | sed -n 's|.*/evaluations/\([^/ ]*\).*|\1|p' | head -n 1)
    ask "$1/api/v1/races/$race/board/" | grep -o '"racer": *"driver"'
    ask "$1/api/v1/evaluations/$run/" | grep -o '"trace_sha256": *"[^"]*"' | head -n 1
    $paddock train start training/rewards/examples/follow_centre_line.py --track oval --set stop_steps=2000 --wait
    $paddock video "$run" /tmp/car/lap.mp4
    inside python manage.py doctor
}
