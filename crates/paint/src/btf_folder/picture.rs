//! One slice as a picture: linear OpenEXR, or PNG of 16 bits.

use std::io::Cursor;

use exr::meta::MetaData;
use exr::prelude::{
    Encoding, Image, Layer, LayerAttributes, ReadChannels as _, ReadLayers as _, SpecificChannels, Vec2,
    WritableImage as _,
};
use image::{DynamicImage, ImageFormat, ImageReader};

/// Largest side of a slice.
const LARGEST: usize = 8192;

/// What a picture is, by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Exr,
    Png,
}

fn kind(bytes: &[u8]) -> Result<Kind, String> {
    if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        Ok(Kind::Exr)
    } else if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Ok(Kind::Png)
    } else if bytes.is_empty() {
        Err("the file is empty; write the slice again".to_owned())
    } else {
        Err("neither OpenEXR nor PNG; slices are linear OpenEXR or PNG of 16 bits".to_owned())
    }
}

/// Width and height, from the head of the file alone.
pub(super) fn size(bytes: &[u8]) -> Result<[usize; 2], String> {
    let [w, h] = match kind(bytes)? {
        Kind::Exr => {
            let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| exr_words(&e))?;
            let header = meta.headers.first().ok_or("the OpenEXR file has no layer")?;
            [header.layer_size.0, header.layer_size.1]
        }
        Kind::Png => {
            let reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
            let (w, h) = reader.into_dimensions().map_err(|e| png_words(&e))?;
            [w as usize, h as usize]
        }
    };
    if (1..=LARGEST).contains(&w) && (1..=LARGEST).contains(&h) {
        Ok([w, h])
    } else {
        Err(format!("{w} × {h} texels; expected 1 to {LARGEST} a side"))
    }
}

fn exr_words(e: &exr::error::Error) -> String {
    format!("the OpenEXR file cannot be read ({e}); slices have channels R, G and B")
}

fn png_words(e: &image::ImageError) -> String {
    format!("the PNG file cannot be read ({e})")
}

/// Decodes a picture into `out`, whose length is its number of texels ([`size`]); PNG values are shares of `full_scale`.
pub(super) fn decode(bytes: &[u8], full_scale: f64, out: &mut [[f32; 3]]) -> Result<(), String> {
    match kind(bytes)? {
        Kind::Exr => decode_exr(bytes, out),
        Kind::Png => decode_png(bytes, full_scale, out),
    }
}

fn decode_exr(bytes: &[u8], out: &mut [[f32; 3]]) -> Result<(), String> {
    let expected = out.len();
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            move |size: Vec2<usize>, _: &_| {
                let sound = size.area() == expected;
                (size.width(), vec![[0.0f32; 3]; if sound { expected } else { 0 }])
            },
            |(width, texels): &mut (usize, Vec<[f32; 3]>), at, (r, g, b): (f32, f32, f32)| {
                if let Some(t) = texels.get_mut(at.y() * *width + at.x()) {
                    *t = [r, g, b];
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| exr_words(&e))?;
    let texels = image.layer_data.channel_data.pixels.1;
    if texels.len() != expected {
        return Err("the layer with channels R, G and B has another size than the first layer".to_owned());
    }
    out.copy_from_slice(&texels);
    Ok(())
}

fn decode_png(bytes: &[u8], full_scale: f64, out: &mut [[f32; 3]]) -> Result<(), String> {
    let image = image::load_from_memory_with_format(bytes, ImageFormat::Png).map_err(|e| png_words(&e))?;
    let step = (full_scale / 65535.0) as f32;
    let mut fill = |values: &[u16], n: usize| {
        for (t, v) in out.iter_mut().zip(values.chunks_exact(n)) {
            // grey stands for three channels, alpha is left out
            *t = if n < 3 { [f32::from(v[0]) * step; 3] } else { [0, 1, 2].map(|c| f32::from(v[c]) * step) };
        }
    };
    match image {
        DynamicImage::ImageRgb16(i) => fill(i.as_raw(), 3),
        DynamicImage::ImageRgba16(i) => fill(i.as_raw(), 4),
        DynamicImage::ImageLuma16(i) => fill(i.as_raw(), 1),
        DynamicImage::ImageLumaA16(i) => fill(i.as_raw(), 2),
        _ => {
            return Err(
                "a PNG of 8 bits, which cannot hold linear texels; write 16 bits or OpenEXR".to_owned()
            );
        }
    }
    Ok(())
}

/// An OpenEXR file of single precision, or of half precision, not compressed: slices are read far more often than they are sent about.
pub(super) fn encode_exr(texels: &[[f32; 3]], [w, h]: [usize; 2], half: bool) -> Result<Vec<u8>, String> {
    use exr::prelude::f16;
    let at = |p: Vec2<usize>| texels.get(p.y() * w + p.x()).copied().unwrap_or([0.0; 3]);
    let mut out = Cursor::new(Vec::new());
    let (attributes, encoding) = (LayerAttributes::named("slice"), Encoding::UNCOMPRESSED);
    let written = if half {
        let pixel = |p| {
            let [r, g, b] = at(p).map(f16::from_f32);
            (r, g, b)
        };
        let layer = Layer::new((w, h), attributes, encoding, SpecificChannels::rgb(pixel));
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut out)
    } else {
        let pixel = |p| {
            let [r, g, b] = at(p);
            (r, g, b)
        };
        let layer = Layer::new((w, h), attributes, encoding, SpecificChannels::rgb(pixel));
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut out)
    };
    written.map_err(|e| e.to_string())?;
    Ok(out.into_inner())
}

/// A PNG file of 16 bits; `full_scale` is what 65535 stands for.
pub(super) fn encode_png(
    texels: &[[f32; 3]],
    [w, h]: [usize; 2],
    full_scale: f64,
) -> Result<Vec<u8>, String> {
    if let Some(v) = texels.iter().flatten().find(|v| **v < 0.0) {
        return Err(format!("PNG cannot hold the texel {v}, which is below 0; write OpenEXR"));
    }
    let values: Vec<u16> = texels
        .iter()
        .flatten()
        .map(|v| (f64::from(*v) / full_scale * 65535.0).round().clamp(0.0, 65535.0) as u16)
        .collect();
    let image = image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(w as u32, h as u32, values)
        .ok_or("its texels do not fill it")?;
    let mut out = Cursor::new(Vec::new());
    DynamicImage::ImageRgb16(image).write_to(&mut out, ImageFormat::Png).map_err(|e| e.to_string())?;
    Ok(out.into_inner())
}
