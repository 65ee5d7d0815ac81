// Plays a script (player_script.py) through ClothPlayer, as the renderer component does.
// Arguments: MODEL SCRIPT RESULT model|unity. The poses are in the space named.
// Or: --fit MODEL: a character of 1.2 times the figure's size and other names, which wears the garment 1.2 times as
// large. Or: --describe MODEL TRIANGLES. Prints the count of vertices, writes triangles as Unity's front faces turn.
using System;
using System.IO;
using System.Runtime.InteropServices;
using System.Text;
using DCloth;

internal static unsafe class Play
{
    private const uint Reset = 4;

    private static float[] Floats(BinaryReader script, int count)
    {
        var values = new float[count];
        Buffer.BlockCopy(script.ReadBytes(4 * count), 0, values, 0, 4 * count);
        return values;
    }

    private static void WriteBytes(BinaryWriter result, void* from, int count)
    {
        var bytes = new byte[count];
        Marshal.Copy((IntPtr)from, bytes, 0, count);
        result.Write(bytes);
    }

    private static void Frame(ClothPlayer player, BinaryReader script, int joints, BinaryWriter result)
    {
        float seconds = script.ReadSingle();
        uint flags = script.ReadUInt32();
        player.Stages = (ClothStages)script.ReadUInt32();
        player.OutsideBody = script.ReadUInt32() != 0;
        bool draw = script.ReadUInt32() != 0;
        float[] rows = Floats(script, 16 * joints);
        player.Pipelined = (flags & Native.DCLOTH_FRAME_PIPELINED) != 0;
        if ((flags & Native.DCLOTH_FRAME_JUMPED) != 0) player.Jump();
        if ((flags & Reset) != 0) player.Reset();
        for (int j = 0; j < player.Bones.Length; ++j)
        {
            for (int i = 0; i < 16; ++i)
                player.JointMatrices[16 * j + i] = rows[16 * player.Bones[j] + i % 4 * 4 + i / 4];
        }
        result.Write((int)player.Advance(seconds, draw));
        dcloth_cloth_info info = player.Cloth.Describe();
        result.Write(info.lag_seconds);
        result.Write(info.tick_share);
        WriteBytes(result, player.Bounds, 6 * sizeof(float));
        WriteBytes(result, player.Vertices, player.VertexCount * player.VertexBytes);
    }

    private static int Describe(string path, string triangles)
    {
        using (ClothModel model = ClothModel.Open(File.ReadAllBytes(path), path))
        {
            ushort[] indices = model.Triangles(ClothSpace.IsLeftHanded(ClothSpace.Unity));
            var bytes = new byte[2 * indices.Length];
            Buffer.BlockCopy(indices, 0, bytes, 0, bytes.Length);
            File.WriteAllBytes(triangles, bytes);
            Console.WriteLine("{0} {1}", model.VertexCount, model.Name);
        }
        return 0;
    }

    private static int Fit(string path)
    {
        using (ClothModel model = ClothModel.Open(File.ReadAllBytes(path), path))
        {
            const float scale = 1.2f;
            string[] names = Array.ConvertAll(model.JointNames, name => "mixamorig:" + name);
            float[] bind = model.BindMatrices(), larger = model.BindMatrices();
            for (int i = 0; i < larger.Length; ++i) larger[i] *= i % 16 >= 12 && i % 4 < 3 ? scale : 1;
            var character = new ClothCharacter { BoneNames = names, BindMatrices = larger };
            using (var plain = new ClothPlayer(model, ClothSpace.Model, model.JointNames))
            using (var fitted = new ClothPlayer(model, ClothSpace.Model, character))
            {
                Marshal.Copy(bind, 0, (IntPtr)plain.JointMatrices, 16 * names.Length);
                Marshal.Copy(larger, 0, (IntPtr)fitted.JointMatrices, 16 * names.Length);
                float off = 0;
                for (int frame = 0; frame < 5; ++frame)
                {
                    if (plain.Advance(1 / 30f) != ClothStatus.Ok || fitted.Advance(1 / 30f) != ClothStatus.Ok) return 1;
                }
                for (int v = 0; v < model.VertexCount; ++v)
                {
                    var a = (float*)(plain.Vertices + v * plain.VertexBytes);
                    var b = (float*)(fitted.Vertices + v * fitted.VertexBytes);
                    for (int c = 0; c < 3; ++c) off = Math.Max(off, Math.Abs(scale * a[c] - b[c]));
                }
                Console.WriteLine("scale {0:F3}, {1} bones, off by {2:F3} mm", fitted.Fit.scale, fitted.Bones.Length,
                                  1000 * off);
            }
        }
        return 0;
    }

    private static int Main(string[] arguments)
    {
        if (arguments.Length == 2 && arguments[0] == "--fit") return Fit(arguments[1]);
        if (arguments.Length == 3 && arguments[0] == "--describe") return Describe(arguments[1], arguments[2]);
        if (arguments.Length != 4 || (arguments[3] != "model" && arguments[3] != "unity")) return 2;
        dcloth_space space = arguments[3] == "unity" ? ClothSpace.Unity : ClothSpace.Model;
        using (var script = new BinaryReader(File.OpenRead(arguments[1])))
        using (var result = new BinaryWriter(File.Create(arguments[2])))
        using (ClothModel model = ClothModel.Open(File.ReadAllBytes(arguments[0]), arguments[0]))
        {
            int joints = script.ReadInt32(), frames = script.ReadInt32();
            string[] names = Encoding.UTF8.GetString(script.ReadBytes(script.ReadInt32())).Split('\n');
            int uvCount = script.ReadInt32();
            float[] uv = uvCount > 0 ? Floats(script, uvCount) : null;
            using (var player = new ClothPlayer(model, space, names, "", uv))
            {
                for (int frame = 0; frame < frames; ++frame) Frame(player, script, joints, result);
                result.Write(player.Cloth.Save());
            }
            Console.WriteLine("{0} frames, {1} of {2} bones read", frames, model.JointNames.Length, joints);
        }
        return 0;
    }
}
