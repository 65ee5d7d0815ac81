// Runs every public static method of a class and counts what fails.
using System;
using System.Reflection;
using DCloth;

internal static class TestRun
{
    private static int failures;

    public static void Check(bool fine, string what)
    {
        if (fine) return;
        Console.Error.WriteLine("failed: " + what);
        ++failures;
    }

    public static ClothException Refused(Action action, ClothStatus status)
    {
        try
        {
            action();
        }
        catch (ClothException e)
        {
            Check(e.Status == status, "status " + status + ", found " + e.Status + ": " + e.Message);
            return e;
        }
        Check(false, "refused with " + status);
        return new ClothException(ClothStatus.Ok, 0, "");
    }

    /// <summary>The process's exit status; memory still lent at the end fails too.</summary>
    public static int All(Type tests)
    {
        int cases = 0;
        foreach (MethodInfo test in tests.GetMethods(BindingFlags.Public | BindingFlags.Static |
                                                     BindingFlags.DeclaredOnly))
        {
            int before = failures;
            ++cases;
            try
            {
                test.Invoke(null, null);
            }
            catch (TargetInvocationException e)
            {
                Check(false, e.InnerException.ToString());
            }
            Console.WriteLine("{0} {1}", failures == before ? "ok" : "FAILED", test.Name);
        }
        Check(AlignedMemory.LiveBytes == 0, AlignedMemory.LiveBytes + " bytes are still lent");
        Console.WriteLine("{0} cases, {1} failures", cases, failures);
        return failures == 0 && cases > 0 ? 0 : 1;
    }
}
