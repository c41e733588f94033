#!/bin/sh
# Renders every reference of this folder again: PYTHON=VENV/bin/python tests/reference/render_all.sh [NAME...]
# from the repository's root. Scenes come from make_scenes.py.
set -eu
names=${*:-cornell cornell_asymmetric sphere plane lights environment environment_turned glass mirror glossy gallery \
    rough_glass absorbing coats normal_map alpha textures many_lights smooth studio}
reference() {
    name=$1; shift
    case " $names " in *" $name "*)
        "${PYTHON:-python3}" scripts/reference_mitsuba.py --size 64x64 --out "tests/reference/$name" "$@";;
    esac
}
reference cornell --scene assets/cornell.glb --fov "-19.65 19.65 19.65 -19.65" --max-depth 8 --spp 160 --seeds 16
reference cornell_asymmetric --scene assets/cornell.glb --fov "-32 18 25 -14" --pose "-0.2 0.3 0.1 0.05 0.1 0.2 0.973396116" \
    --max-depth 3 --spp 160 --seeds 16
reference sphere --scene assets/sphere.glb --fov "-45 45 45 -45" --max-depth 12 --spp 64 --seeds 16
reference plane --scene assets/plane.glb --fov "-50 30 20 -40" --max-depth 2 --spp 64 --seeds 16
reference lights --scene tests/reference/lights.gltf --fov "-30 30 26 -26" --max-depth 4 --spp 512 --seeds 16
reference environment --scene tests/reference/environment.gltf --environment tests/reference/environment.hdr \
    --fov "-50 50 50 -50" --max-depth 3 --spp 160 --seeds 16
# Behind the camera and above: the half of the map that the first view does not see.
reference environment_turned --scene tests/reference/environment.gltf --environment tests/reference/environment.hdr \
    --environment-strength 0.5 --pose "1.5 2.2 0.2 0.1 0.9 0.3 0.3" --fov "-60 70 65 -55" --max-depth 2 --spp 96 --seeds 16
reference glass --scene tests/reference/glass.gltf --fov "-26 26 24 -24" --max-depth 7 --spp 256 --seeds 16
reference mirror --scene tests/reference/mirror.gltf --fov "-26 26 24 -24" --max-depth 5 --spp 160 --seeds 16
reference glossy --scene tests/reference/glossy.gltf --fov "-26 26 24 -24" --max-depth 4 --spp 160 --seeds 16
reference gallery --scene assets/gallery.glb --fov "-40 40 40 -40" --max-depth 4 --spp 96 --seeds 16
reference rough_glass --scene tests/reference/rough_glass.gltf --fov "-26 26 24 -24" --max-depth 6 --spp 256 --seeds 16
reference absorbing --scene tests/reference/absorbing.gltf --fov "-26 26 24 -24" --max-depth 7 --spp 256 --seeds 16
reference coats --scene tests/reference/coats.gltf --fov "-26 26 24 -24" --max-depth 5 --spp 192 --seeds 16
reference normal_map --scene tests/reference/normal_map.gltf --fov "-26 26 24 -24" --max-depth 3 --spp 160 --seeds 16
reference alpha --scene tests/reference/alpha.gltf --fov "-26 26 24 -24" --max-depth 3 --spp 192 --seeds 16
reference textures --scene tests/reference/textures.gltf --fov "-28 28 26 -26" --max-depth 3 --spp 160 --seeds 16
reference many_lights --scene tests/reference/many_lights.gltf --fov "-26 26 24 -24" --max-depth 3 --spp 320 --seeds 16
reference smooth --scene tests/reference/smooth.gltf --fov "-26 26 24 -24" --max-depth 5 --spp 256 --seeds 16
reference studio --scene tests/reference/studio.gltf --environment tests/reference/environment.hdr \
    --environment-strength 2.5 --fov "-38 38 30 -38" --max-depth 5 --spp 160 --seeds 16
