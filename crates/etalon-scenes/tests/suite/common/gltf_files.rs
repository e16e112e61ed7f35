//! glTF files with known contents.

use std::fmt::Write;
use std::io::Cursor;

/// Collects binary data, and the JSON of its views and accessors.
#[derive(Default)]
pub(crate) struct Binary {
    pub(crate) bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Binary {
    /// A view of some bytes; its index.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        self.views.push(format!(
            r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#,
            self.bytes.len(),
            bytes.len()
        ));
        self.bytes.extend_from_slice(bytes);
        self.views.len() - 1
    }

    /// An accessor with the view given; its index.
    pub(crate) fn accessor(
        &mut self,
        view: usize,
        count: usize,
        kind: &str,
        component: u32,
    ) -> usize {
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"count":{count},"type":"{kind}","componentType":{component}}}"#
        ));
        self.accessors.len() - 1
    }

    /// An accessor of floats.
    pub(crate) fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values
            .as_flattened()
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        let view = self.view(&bytes);
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"]
            .get(N)
            .unwrap_or(&"MAT4");
        self.accessor(view, values.len(), kind, 5126)
    }

    /// An accessor of 16-bit indices.
    pub(crate) fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.accessor(view, values.len(), "SCALAR", 5123)
    }

    /// An accessor whose JSON is given; its index.
    pub(crate) fn raw(&mut self, json: String) -> usize {
        self.accessors.push(json);
        self.accessors.len() - 1
    }

    /// The JSON of a file whose other members are `rest`; the buffer has
    /// `source` before its length: nothing or a URI.
    pub(crate) fn json(&self, source: &str, rest: &str) -> String {
        let mut json = String::from(r#"{"asset":{"version":"2.0"},"#);
        write!(
            json,
            r#""buffers":[{{{source}"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
            self.bytes.len(),
            self.views.join(","),
            self.accessors.join(",")
        )
        .unwrap();
        json
    }

    /// A binary container.
    pub(crate) fn glb(&self, rest: &str) -> Vec<u8> {
        glb(self.json("", rest).as_bytes(), &self.bytes)
    }
}

pub(crate) fn glb(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let mut chunks = Vec::new();
    for (kind, data, fill) in [(b"JSON", json, b' '), (b"BIN\0", binary, 0)] {
        let length = data.len().next_multiple_of(4);
        chunks.extend_from_slice(&(length as u32).to_le_bytes());
        chunks.extend_from_slice(kind);
        chunks.extend_from_slice(data);
        chunks.resize(chunks.len() + length - data.len(), fill);
    }
    let mut bytes = b"glTF".to_vec();
    bytes.extend_from_slice(&2_u32.to_le_bytes());
    bytes.extend_from_slice(&(chunks.len() as u32 + 12).to_le_bytes());
    bytes.extend_from_slice(&chunks);
    bytes
}

/// A PNG file of 2 × 2 texels, whose first is red.
pub(crate) fn png() -> Vec<u8> {
    encoded(image::ImageFormat::Png)
}

pub(crate) fn encoded(format: image::ImageFormat) -> Vec<u8> {
    let texels = [255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 9, 9].to_vec();
    let picture = image::RgbImage::from_raw(2, 2, texels).unwrap();
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

pub(crate) fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let word = (0..3).fold(0_u32, |w, i| {
            w << 8 | u32::from(*group.get(i).unwrap_or(&0))
        });
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= group.len() {
                char::from(digit)
            } else {
                '='
            });
        }
    }
    text
}

/// A quad with everything that is read: skin, animations, textures, lights,
/// extensions. The first is the binary data, the second the rest of the JSON.
pub(crate) fn everything() -> (Binary, String) {
    let mut b = Binary::default();
    let positions = b.floats(&[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ]);
    let normals = b.floats(&[[0.0, 0.0, 2.0], [0.0, 0.0, 1.0], [0.0; 3], [0.0, 0.0, 1.0]]);
    let uv = b.floats(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    let bytes = [0, 255, 255, 0, 0, 255, 128, 0, 0].map(|x: u8| x);
    let second = b.view(&bytes[..8]);
    let second = b.raw(format!(
        r#"{{"bufferView":{second},"count":4,"type":"VEC2","componentType":5121,"normalized":true}}"#
    ));
    let joints = b.view(&[0, 1, 0, 0].repeat(4));
    let joints = b.accessor(joints, 4, "VEC4", 5121);
    let weights = b.floats(&[
        [2.0, 0.0, 0.0, 0.0],
        [0.5, 0.5, 0.0, 0.0],
        [0.5, 0.5, 0.0, 0.0],
        [1.0, 0.0, 0.0, 0.0],
    ]);
    let colours = b.floats(&[[1.0, 0.5, 0.25]; 4]);
    let indices = b.indices(&[0, 1, 2, 0, 2, 3]);
    let binds = b.floats(&[
        glam::Mat4::IDENTITY.to_cols_array(),
        glam::Mat4::from_scale(glam::Vec3::splat(2.0)).to_cols_array(),
    ]);
    let times = b.floats(&[[0.0], [1.0]]);
    let moves = b.floats(&[[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    let turns = b.view(
        &[0_i16, 0, 0, 32767, 0, 32767, 0, 0]
            .map(i16::to_le_bytes)
            .concat(),
    );
    let turns = b.raw(format!(
        r#"{{"bufferView":{turns},"count":2,"type":"VEC4","componentType":5122,"normalized":true}}"#
    ));
    let cubic = b.floats(&[[0.0; 3], [1.0; 3], [0.0; 3], [0.0; 3], [2.0; 3], [0.0; 3]]);
    let picture = b.view(&png());
    let rest = format!(
        r#""extensionsRequired":["KHR_texture_transform","KHR_materials_volume"],
"extensions":{{"KHR_lights_punctual":{{"lights":[
 {{"type":"directional","color":[1,0.5,0.25],"intensity":3}},
 {{"type":"spot","name":"lamp","intensity":70,"range":9,"spot":{{"innerConeAngle":0.2,"outerConeAngle":0.6}}}}]}}}},
"images":[{{"bufferView":{picture},"mimeType":"image/png","name":"four"}}],
"samplers":[{{"magFilter":9728,"minFilter":9985,"wrapS":33071,"wrapT":33648}}],
"textures":[{{"source":0,"sampler":0}},{{"source":0}}],
"materials":[{{"name":"all","pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.25,0.125,1],"metallicFactor":0.5,
  "roughnessFactor":0.25,"baseColorTexture":{{"index":0}},"metallicRoughnessTexture":{{"index":1,"texCoord":1}}}},
 "normalTexture":{{"index":1,"scale":0.5,"extensions":{{"KHR_texture_transform":{{"offset":[0.5,0.25],"rotation":1.5,"scale":[2,3],"texCoord":1}}}}}},
 "occlusionTexture":{{"index":0,"strength":0.75}},
 "emissiveFactor":[1,0.5,0],"emissiveTexture":{{"index":0,"extensions":{{"KHR_texture_transform":{{"scale":[4,4]}}}}}},
 "alphaMode":"MASK","alphaCutoff":0.25,"doubleSided":true,
 "extensions":{{"KHR_materials_emissive_strength":{{"emissiveStrength":5}},"KHR_materials_ior":{{"ior":1.33}},
  "KHR_materials_transmission":{{"transmissionFactor":0.9}},
  "KHR_materials_volume":{{"thicknessFactor":0.1,"attenuationDistance":2,"attenuationColor":[1,0.5,0.5]}}}}}}],
"cameras":[{{"type":"perspective","perspective":{{"yfov":0.8,"znear":0.05}}}},
 {{"type":"orthographic","orthographic":{{"xmag":1,"ymag":1,"zfar":10,"znear":0.1}}}}],
"meshes":[{{"name":"quad","primitives":[{{"attributes":{{"POSITION":{positions},"NORMAL":{normals},"TEXCOORD_0":{uv},
  "TEXCOORD_1":{second},"JOINTS_0":{joints},"WEIGHTS_0":{weights},"COLOR_0":{colours}}},"indices":{indices},"material":0}}]}}],
"skins":[{{"name":"skin","joints":[1,2],"inverseBindMatrices":{binds}}}],
"nodes":[{{"name":"shown","mesh":0,"skin":0,"children":[1,3,4]}},{{"name":"a","children":[2]}},
 {{"name":"b","translation":[0,1,0],"rotation":[0,0,0,2],"scale":[1,2,1]}},
 {{"name":"eye","camera":0,"translation":[0,0,5],"extensions":{{"KHR_lights_punctual":{{"light":1}}}}}},
 {{"name":"flat","camera":1,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,7,0,0,1]}},{{"name":"hidden","mesh":0}}],
"scene":0,"scenes":[{{"nodes":[0]}}],
"animations":[{{"name":"wave","samplers":[{{"input":{times},"output":{moves}}},
  {{"input":{times},"output":{turns},"interpolation":"STEP"}},{{"input":{times},"output":{cubic},"interpolation":"CUBICSPLINE"}}],
 "channels":[{{"sampler":0,"target":{{"node":1,"path":"translation"}}}},{{"sampler":1,"target":{{"node":2,"path":"rotation"}}}},
  {{"sampler":2,"target":{{"node":2,"path":"scale"}}}}]}}]"#
    );
    (b, rest)
}
